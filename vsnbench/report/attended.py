"""Who stood beside the robot: sessions, and what each person judged, overruled and had to mend.

There is nothing to say of one person in one session.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import Engine, select

from vsnbench.database.engine import record_errors
from vsnbench.database.episode_entries import INTERVENTION
from vsnbench.database.tables import Event, Robot, Session
from vsnbench.report.judgements import last_words
from vsnbench.report.record import Record
from vsnbench.report.summary import outcomes_of
from vsnbench.statistics.clustered import Outcomes
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.permutation import Stratum, stratified_permutation
from vsnbench.statistics.rates import Proportion

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class AttendedSession:
    """One operator with one robot for a stretch of time."""

    number: int
    operator: str
    robot: str
    began_at: datetime
    ended_at: datetime
    """The end of its last episode where it lasts, or nobody wrote down when it ended."""
    outcomes: Outcomes
    """Of the trials that count."""
    attempts: int
    interventions: int

    @property
    def hours(self) -> float:
        """How long it took."""
        return max(0.0, (self.ended_at - self.began_at).total_seconds()) / 3600


@dataclass(frozen=True, slots=True)
class Operator:
    """What one person did."""

    name: str
    sessions: int
    hours: float
    """Of these sessions."""
    judged: Outcomes
    """Trials that count by this person's verdict."""
    overruled: int
    """Of these, those in which the protocol had said otherwise."""
    interventions: int
    p: float | None
    """Of success having nothing to do with whether this person or another judged, model for model and goal for goal;
    corrected for as many persons. None where there is no other."""


@dataclass(frozen=True, slots=True)
class Attended:
    """Sessions in the order of time, and persons by name."""

    sessions: tuple[AttendedSession, ...]
    operators: tuple[Operator, ...]


def read_attended(engine: Engine, record: Record) -> Attended | None:
    """Return who stood beside the robot; None where there was one person in one session, or nobody.

    Raises:
        RecordError: the database cannot be used.
    """
    with record_errors(engine), engine.connect() as connection:
        rows = connection.execute(
            select(Session.id, Session.operator, Robot.title, Session.began_at, Session.ended_at)
            .join(Robot, Robot.id == Session.robot_id)
            .where(Session.id.in_([int(number) for number in record.episodes["session"].unique() if number]))
            .order_by(Session.began_at, Session.id)
        ).all()
        acted = connection.execute(select(Event.episode_id, Event.author).where(Event.kind == INTERVENTION)).all()
    judged_by, overruled = _judged(engine)
    if len(rows) < 2 and not acted and not judged_by:
        return None
    known = dict(zip(record.episodes["episode"].tolist(), record.episodes["session"].tolist(), strict=True))
    interventions = [(known[episode], author) for episode, author in acted if episode in known]
    sessions = tuple(_session(record, row, sum(session == row.id for session, _ in interventions)) for row in rows)
    counted = record.counted()
    judges = counted["episode"].map(judged_by)
    names = (
        {one.operator for one in sessions} | set(judges.dropna()) | {author for _, author in interventions if author}
    )
    if len(names) < 2 and len(sessions) < 2:
        return None
    ordered = sorted(names)
    found = [_chance(counted, judges, name) for name in ordered]
    asked = [p for p in found if p is not None]
    # Two persons are one question, asked from either side.
    corrected = iter(asked if len(asked) <= 2 else holm(asked))
    operators = tuple(
        Operator(
            name=name,
            sessions=sum(one.operator == name for one in sessions),
            hours=sum(one.hours for one in sessions if one.operator == name),
            judged=outcomes_of(counted[judges == name]),
            overruled=sum(overruled.get(number, False) for number in counted.loc[judges == name, "episode"].tolist()),
            interventions=sum(author == name for _, author in interventions),
            p=None if p is None else next(corrected),
        )
        for name, p in zip(ordered, found, strict=True)
    )
    return Attended(sessions, operators)


def _session(record: Record, row: Any, interventions: int) -> AttendedSession:
    mine = record.episodes[record.episodes["session"] == row.id]
    counted = record.counted()
    last = mine["ended_at"].max()
    return AttendedSession(
        number=row.id,
        operator=row.operator,
        robot=row.title,
        began_at=row.began_at,
        ended_at=row.ended_at or (last.to_pydatetime() if last == last else row.began_at),
        outcomes=outcomes_of(counted[counted["session"] == row.id]),
        attempts=len(mine),
        interventions=interventions,
    )


def _judged(engine: Engine) -> tuple[Mapping[int, str], Mapping[int, bool]]:
    """Return by whose word each episode stands that a person judged, and whether that overruled the protocol."""
    words = last_words(engine)
    return (
        {number: last.author for number, (_, last) in words.items()},
        {number: first is not None and first.success != last.success for number, (first, last) in words.items()},
    )


def _chance(counted: "pd.DataFrame", judges: "pd.Series[str]", name: str) -> float | None:
    mine, others = judges == name, judges.notna() & (judges != name)
    if not mine.any() or not others.any():
        return None
    strata = []
    for _, rows in counted.groupby(["condition", "goal"], observed=True):
        sides = [rows.loc[which.loc[rows.index], "success"] for which in (mine, others)]
        strata.append(Stratum(*(Proportion(int(side.sum()), len(side)) for side in sides)))
    return stratified_permutation(strata)
