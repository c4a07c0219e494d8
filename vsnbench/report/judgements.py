"""How often people overruled the protocol, and who: the first answer of the machine against the verdict that stands."""

from dataclasses import dataclass
from typing import Any

from sqlalchemy import Engine, select

from vsnbench.database.engine import record_errors
from vsnbench.database.tables import Verdict
from vsnbench.report.record import Record

PERSON, PROTOCOL = "person", "protocol"


@dataclass(frozen=True, slots=True)
class Overruling:
    """One verdict of the protocol that a person changed."""

    episode: int
    before: bool | None
    """Success as the protocol had it; None for void."""
    after: bool | None
    author: str
    reason: str


@dataclass(frozen=True, slots=True)
class Judgements:
    """What people made of the protocol's verdicts under one condition."""

    condition: int
    judged: int
    """Episodes whose standing verdict is a person's, and that the protocol had judged or proposed before."""
    overruled: tuple[Overruling, ...]

    @property
    def rate(self) -> float:
        """Share of them that were changed."""
        return len(self.overruled) / self.judged if self.judged else float("nan")


def last_words(engine: Engine) -> dict[int, tuple[Any, Any]]:
    """Return the protocol's first verdict, or None, and a person's that stands, of every episode that has the latter.

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
    standing: dict[int, Any] = {}
    for row in rows:
        if row.source == PROTOCOL:
            first.setdefault(row.episode_id, row)
        if not row.proposed:
            standing[row.episode_id] = row
    return {number: (first.get(number), last) for number, last in standing.items() if last.source == PERSON}


def read_judgements(engine: Engine, record: Record) -> tuple[Judgements, ...]:
    """Return what people judged, for each condition in which they did.

    Raises:
        RecordError: the database cannot be used.
    """
    words = last_words(engine)
    if not words:
        return ()
    condition_of = dict(zip(record.episodes["episode"].tolist(), record.episodes["condition"].tolist(), strict=True))
    counts: dict[int, int] = {}
    overruled: dict[int, list[Overruling]] = {}
    for number, (first, last) in words.items():
        if first is None or number not in condition_of:
            continue
        condition, before = condition_of[number], first.success
        counts[condition] = counts.get(condition, 0) + 1
        if before != last.success:
            why = last.note or last.reason
            overruled.setdefault(condition, []).append(Overruling(number, before, last.success, last.author, why))
    return tuple(Judgements(each, counts[each], tuple(overruled.get(each, ()))) for each in sorted(counts))
