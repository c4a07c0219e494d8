"""Reads a study with its trials and lists the deviations from its plan."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from vsnbench.report.study.conclusion import conclusion
from vsnbench.report.study.primary import Primary, analyse, in_order
from vsnbench.results.goals import goals_of_campaign
from vsnbench.results.reading.read_model import HIDDEN
from vsnbench.results.schema.engine import reading
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.studies.entries import AMEND, OVER, SESSION, SESSION_END, SUSPEND, UNBLIND, RecordedStudy
from vsnbench.results.studies.entries import StudyTrialProgress as Standing
from vsnbench.results.studies.queries import trials_of, twin_rates
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.lock import JUDGING
from vsnbench.text.sanitize import counted
from vsnbench.values.goal import GoalKind


@dataclass(frozen=True, slots=True)
class Deviation:
    """A deviation of the conduct from the plan."""

    what: str
    words: str


@dataclass(frozen=True, slots=True)
class StudyFindings:
    """A study with its trials, analysis and deviations."""

    recorded: RecordedStudy
    plan: StudyFile
    progress: tuple[Standing, ...]
    primary: Primary
    deviations: tuple[Deviation, ...]
    conclusion: str
    goal_kinds: Mapping[str, GoalKind] = field(default_factory=dict)
    """Kinds of the goals that are not categories."""

    @property
    def shown(self) -> Mapping[str, str]:
        """Displayed names of the arms."""
        return {arm.name: self.recorded.shown(arm.name) for arm in self.recorded.arms}

    def of(self, arm: str) -> list[Standing]:
        """Return the trials of an arm."""
        return [trial for trial in self.progress if trial.arm == arm]


def read_findings(
    url: str,
    recorded: RecordedStudy,
    plan: StudyFile,
    changed: str = "",
    *,
    differences: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> StudyFindings:
    """Read a study and analyse it.

    Args:
        url: SQLAlchemy URL.
        recorded: the study.
        plan: its plan, as locked or last amended.
        changed: differences of the file from the plan; empty if there are none.
        differences: differences of the record from its lock and log.
        remarks: checks that could not be made.

    Raises:
        RecordError: the record cannot be read.
    """
    with open_record(url) as engine:
        progress = trials_of(engine, recorded.id)
        with reading(engine).begin() as connection:
            goals = [goals_of_campaign(connection, arm.campaign_id) for arm in recorded.arms]
        twin = {}
        if plan.real_cells is not None and isinstance(plan.primary, Rate):
            twin = twin_rates(engine, recorded, plan.primary.arm)
    # In the order of the codes, because the order of the file would reveal the arms.
    primary = in_order(analyse(plan, progress, twin), {arm.name: arm.code for arm in recorded.arms})
    shown = {arm.name: recorded.shown(arm.name) for arm in recorded.arms}
    found = [Deviation("record changed", words) for words in differences]
    found += [Deviation("not verified", words) for words in remarks]
    concluded = conclusion(plan, primary, shown, _judging_changed_after(recorded))
    if differences:
        concluded = (
            f"The record was changed outside of vsnbench (see deviations); the conclusion is unreliable: {concluded}"
        )
    return StudyFindings(
        recorded,
        plan,
        progress,
        primary,
        (*found, *_deviations(recorded, plan, progress, shown, changed)),
        concluded,
        {name: goal.kind for campaign in goals for name, goal in campaign.items() if goal is not None},
    )


def _judging_changed_after(recorded: RecordedStudy) -> int | None:
    """Return the number of results when a judging field was first changed; None if never or without results."""
    for entry in recorded.entries:
        fields = {line[1:].partition(":")[0].strip() for line in entry.text.splitlines()}
        if entry.kind == AMEND and entry.results and fields & set(JUDGING):
            return entry.results
    return None


def _deviations(
    recorded: RecordedStudy, plan: StudyFile, progress: Sequence[Standing], shown: Mapping[str, str], changed: str
) -> Iterator[Deviation]:
    if changed:
        yield Deviation("file", changed)
    over = any(entry.kind == OVER for entry in recorded.entries)
    for entry in recorded.entries:
        when = f"{entry.created_at:%Y-%m-%d %H:%M} by {entry.author} after {entry.results} results: {entry.reason}"
        if entry.kind == AMEND:
            lines = "; ".join(entry.text.splitlines())
            yield Deviation("amendment", f"{when} ({HIDDEN if recorded.reveals_arm(lines) else lines})")
        elif entry.kind == UNBLIND and entry.results < len(progress) and not over:
            yield Deviation("unblinded early", f"{when} ({entry.results} of {len(progress)} trials)")
        elif entry.kind == UNBLIND:
            yield Deviation("unblinded", when)
    if recorded.blind is False:
        yield Deviation("not blinded", "people saw the models' names")
    suspended = Counter(entry.text.partition(":")[0] for entry in recorded.entries if entry.kind == SUSPEND)
    for arm, times in suspended.items():
        yield Deviation("left out", f"{shown.get(arm, arm)}: its model was not available in {times} sessions")
    for arm, name in shown.items():
        if voids := sum(trial.voids for trial in progress if trial.arm == arm):
            yield Deviation("void attempts", f"{name}: {voids}, each repeated")
    if plan.of_progress and (unknown := [t for t in progress if t.success is not None and t.progress is None]):
        episodes = ", ".join(str(trial.episode_id) for trial in unknown[:5]) + (", …" if len(unknown) > 5 else "")
        effect = "left out" if plan.stopping == "plan" else "later units wait; amend `primary` to success"
        yield Deviation("progress unknown", f"{counted(len(unknown), 'trial')} (episodes {episodes}): {effect}")
    if twice := sum(trial.results > 1 for trial in progress):
        yield Deviation("repeated trials", f"{twice} trials have results from several records; the first counts")
    began = sorted(
        (trial for trial in progress if trial.started_at is not None), key=lambda trial: str(trial.started_at)
    )
    out_of_turn = sum(earlier.rank > later.rank for earlier, later in pairwise(began))
    if out_of_turn:
        yield Deviation("order", f"{out_of_turn} trials were run after a trial that was scheduled later")
    if plan.operators:
        others = {trial.operator for trial in progress if trial.done} - set(plan.operators)
        if others:
            yield Deviation("operators", f"not named in the plan: {', '.join(sorted(others))}")
    ended = {entry.process_id for entry in recorded.entries if entry.kind == SESSION_END}
    sessions = [entry for entry in recorded.entries if entry.kind == SESSION]
    if died := sum(entry.process_id not in ended for entry in sessions):
        yield Deviation("sessions", f"{died} of {len(sessions)} ended abnormally")
