"""Agreement of second judgements with the verdicts that count."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import Engine

from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.results.reading.read_model import COUNTED, VOID
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.second_judgements import Outcome, SecondJudgement, person_key, second_judgements
from vsnbench.statistics.agreement import JudgeAgreement, JudgedTwice, judge_agreement


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

    Raises:
        RecordError: the database cannot be used.
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
