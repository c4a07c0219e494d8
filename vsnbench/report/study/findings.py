"""Reads a study and everything that happened to it: what was planned, what was run, and where the two differ."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from vsnbench.database.blinding import HIDDEN
from vsnbench.database.migrate import open_record
from vsnbench.database.study_entries import AMEND, OVER, SESSION, SESSION_END, SUSPEND, UNBLIND, RecordedStudy
from vsnbench.database.study_entries import StudyTrialStanding as Standing
from vsnbench.database.study_queries import trials_of
from vsnbench.report.study.primary import Primary, analyse, conclusion, in_order
from vsnbench.study.file import StudyFile
from vsnbench.study.lock import JUDGING


@dataclass(frozen=True, slots=True)
class Deviation:
    """Where what was run is not what was planned."""

    what: str
    words: str


@dataclass(frozen=True, slots=True)
class StudyFindings:
    """A study, read whole."""

    recorded: RecordedStudy
    plan: StudyFile
    standing: tuple[Standing, ...]
    primary: Primary
    deviations: tuple[Deviation, ...]
    conclusion: str

    @property
    def shown(self) -> Mapping[str, str]:
        """What the arms are called to people now."""
        return {arm.name: self.recorded.shown(arm.name) for arm in self.recorded.arms}

    def of(self, arm: str) -> list[Standing]:
        """Return an arm's trials."""
        return [one for one in self.standing if one.arm == arm]


def read_findings(url: str, recorded: RecordedStudy, plan: StudyFile, changed: str = "") -> StudyFindings:
    """Read what became of a study.

    Args:
        url: any SQLAlchemy URL.
        recorded: the study.
        plan: what was locked, or last amended.
        changed: in what the file is not what was locked; empty when it is.

    Raises:
        RecordError: the record cannot be read.
    """
    with open_record(url) as engine:
        standing = trials_of(engine, recorded.id)
    # In the order of the codes: that of the file would tell which is which.
    primary = in_order(analyse(plan, standing), {arm.name: arm.code for arm in recorded.arms})
    shown = {arm.name: recorded.shown(arm.name) for arm in recorded.arms}
    return StudyFindings(
        recorded,
        plan,
        standing,
        primary,
        tuple(_deviations(recorded, plan, standing, shown, changed)),
        conclusion(plan, primary, shown, _judging_changed_after(recorded)),
    )


def _judging_changed_after(recorded: RecordedStudy) -> int | None:
    """Return how many results there were when the way of judging was first changed; None for none or never."""
    for entry in recorded.entries:
        fields = {line[1:].partition(":")[0].strip() for line in entry.text.splitlines()}
        if entry.kind == AMEND and entry.results and fields & set(JUDGING):
            return entry.results
    return None


def _deviations(
    recorded: RecordedStudy, plan: StudyFile, standing: Sequence[Standing], shown: Mapping[str, str], changed: str
) -> Iterator[Deviation]:
    if changed:
        yield Deviation("file", changed)
    over = any(entry.kind == OVER for entry in recorded.entries)
    for entry in recorded.entries:
        when = f"{entry.created_at:%Y-%m-%d %H:%M} by {entry.author} after {entry.results} results: {entry.reason}"
        if entry.kind == AMEND:
            lines = "; ".join(entry.text.splitlines())
            yield Deviation("amendment", f"{when} ({HIDDEN if recorded.gives_away(lines) else lines})")
        elif entry.kind == UNBLIND and entry.results < len(standing) and not over:
            yield Deviation("unblinded early", f"{when} ({entry.results} of {len(standing)} trials)")
        elif entry.kind == UNBLIND:
            yield Deviation("unblinded", when)
    if recorded.blind is False:
        yield Deviation("not blind", "people saw which model drove")
    suspended = Counter(entry.text.partition(":")[0] for entry in recorded.entries if entry.kind == SUSPEND)
    for arm, times in suspended.items():
        yield Deviation("left out", f"{shown.get(arm, arm)}: its model could not be used in {times} sessions")
    for arm, name in shown.items():
        if voids := sum(one.voids for one in standing if one.arm == arm):
            yield Deviation("void attempts", f"{name}: {voids}, each run again")
    if twice := sum(one.results > 1 for one in standing):
        yield Deviation("run twice", f"{twice} trials have results from more than one record; the first counts")
    began = sorted((one for one in standing if one.started_at is not None), key=lambda one: str(one.started_at))
    out_of_turn = sum(one.rank > later.rank for one, later in pairwise(began))
    if out_of_turn:
        yield Deviation("order", f"{out_of_turn} trials were run after one that was scheduled later")
    if plan.operators:
        others = {one.operator for one in standing if one.done} - set(plan.operators)
        if others:
            yield Deviation("operators", f"{', '.join(sorted(others))} not named in the plan")
    ended = {entry.process_id for entry in recorded.entries if entry.kind == SESSION_END}
    sessions = [entry for entry in recorded.entries if entry.kind == SESSION]
    if died := sum(entry.process_id not in ended for entry in sessions):
        yield Deviation("sessions", f"{died} of {len(sessions)} did not end by themselves")
