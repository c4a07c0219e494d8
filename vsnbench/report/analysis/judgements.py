"""How often operators overruled the protocol's verdict, and how far blind second judgements agree with it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Engine, select

from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.results.reading.read_model import COUNTED, VOID
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import Verdict
from vsnbench.results.second_judgements import Outcome, SecondJudgement, person_key, second_judgements
from vsnbench.statistics.agreement import JudgeAgreement, JudgedTwice, judge_agreement

PERSON, PROTOCOL = "person", "protocol"


@dataclass(frozen=True, slots=True)
class OverruledVerdict:
    """A verdict of the protocol that an operator changed."""

    episode: int
    before: bool | None
    """Success according to the protocol; None for void."""
    after: bool | None
    author: str
    reason: str


@dataclass(frozen=True, slots=True)
class Judgements:
    """Operators' judgements of the protocol's verdicts under one condition."""

    condition: int
    judged: int
    """Episodes whose current verdict is an operator's, and that the protocol had judged or proposed before."""
    overruled: tuple[OverruledVerdict, ...]

    @property
    def rate(self) -> float:
        """Share of the judged episodes whose verdict was changed."""
        return len(self.overruled) / self.judged if self.judged else float("nan")


def latest_judgements(engine: Engine) -> dict[int, tuple[Any, Any]]:
    """Return the protocol's first verdict (or None) and the operator's current verdict of each judged episode."""
    judged = select(Verdict.episode_id).where(Verdict.source == PERSON)
    with record_errors(engine), engine.connect() as connection:
        rows = connection.execute(
            select(
                *(Verdict.episode_id, Verdict.success, Verdict.source, Verdict.proposed),
                *(Verdict.author, Verdict.reason, Verdict.note),
            )
            .where(Verdict.episode_id.in_(judged))
            .order_by(Verdict.episode_id, Verdict.id)
        ).all()
    first: dict[int, Any] = {}
    current: dict[int, Any] = {}
    for row in rows:
        if row.source == PROTOCOL:
            first.setdefault(row.episode_id, row)
        if not row.proposed:
            current[row.episode_id] = row
    return {number: (first.get(number), last) for number, last in current.items() if last.source == PERSON}


def read_judgements(engine: Engine, record: ReportData) -> tuple[Judgements, ...]:
    """Return the operators' judgements of each condition that has any."""
    judgements = latest_judgements(engine)
    if not judgements:
        return ()
    condition_of = dict(zip(record.episodes["episode"].tolist(), record.episodes["condition"].tolist(), strict=True))
    counts: dict[int, int] = {}
    overruled: dict[int, list[OverruledVerdict]] = {}
    for number, (first, last) in judgements.items():
        if first is None or number not in condition_of:
            continue
        condition, before = condition_of[number], first.success
        counts[condition] = counts.get(condition, 0) + 1
        if before != last.success:
            reason = last.note or last.reason
            change = OverruledVerdict(number, before, last.success, last.author, reason)
            overruled.setdefault(condition, []).append(change)
    return tuple(
        Judgements(condition, counts[condition], tuple(overruled.get(condition, ()))) for condition in sorted(counts)
    )


@dataclass(frozen=True, slots=True)
class DifferingJudgement:
    """An episode in which a second judgement differs from the verdict."""

    episode: int
    goal: str
    start: int
    first: Outcome
    second: Outcome
    text: str
    """What the rater saw."""


@dataclass(frozen=True, slots=True)
class RaterAgreement:
    """Agreement of one rater with the verdicts."""

    rater: str
    agreement: JudgeAgreement
    outcomes: Mapping[tuple[Outcome, Outcome], int]
    """Number of episodes by the verdict's and the rater's outcome."""
    differing: tuple[DifferingJudgement, ...]


def read_rater_agreements(engine: Engine, record: ReportData) -> tuple[RaterAgreement, ...]:
    """Return the agreement of each rater with the current verdicts, by name.

    Episodes whose verdict was retracted have none and are left out.
    """
    with record_errors(engine), engine.connect() as connection:
        given = second_judgements(connection)
    if not given:
        return ()
    wanted = {judgement.episode for judgement in given}
    rows = record.episodes[record.episodes["episode"].isin(wanted) & record.episodes["state"].isin([COUNTED, VOID])]
    columns = ("condition", "goal", "start", "state", "success")
    known = dict(
        zip(rows["episode"].tolist(), zip(*(rows[name].tolist() for name in columns), strict=True), strict=True)
    )
    sites = {condition.number: condition.site_sha256 for condition in record.conditions}
    raters: dict[str, list[_Pair]] = {}
    for judgement in given:
        if judgement.episode in known:
            condition, goal, start, state, success = known[judgement.episode]
            first = Outcome.VOID if state == VOID else Outcome.of(success)
            pair = _Pair((sites[condition], start), goal, start, first, judgement)
            raters.setdefault(person_key(judgement.rater), []).append(pair)
    return tuple(_agreement(pairs) for _, pairs in sorted(raters.items()))


@dataclass(frozen=True, slots=True)
class _Pair:
    cluster: tuple[str, int]
    goal: str
    start: int
    first: Outcome
    second: SecondJudgement


def _agreement(pairs: Sequence[_Pair]) -> RaterAgreement:
    return RaterAgreement(
        rater=pairs[-1].second.rater,
        agreement=judge_agreement([JudgedTwice(pair.cluster, pair.first, pair.second.outcome) for pair in pairs]),
        outcomes=Counter((pair.first, pair.second.outcome) for pair in pairs),
        differing=tuple(
            DifferingJudgement(
                pair.second.episode, pair.goal, pair.start, pair.first, pair.second.outcome, pair.second.text
            )
            for pair in pairs
            if pair.first is not pair.second.outcome
        ),
    )
