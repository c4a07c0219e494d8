"""How often operators overruled the protocol's verdict."""

from dataclasses import dataclass
from typing import Any

from sqlalchemy import Engine, select

from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import Verdict

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
    """Return the protocol's first verdict (or None) and the operator's current verdict of each judged episode.

    Raises:
        RecordError: the database cannot be used.
    """
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
    """Return the operators' judgements of each condition that has any.

    Raises:
        RecordError: the database cannot be used.
    """
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
