"""Operators and their sessions: judgements, overruled verdicts and interventions."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from sqlalchemy import Engine, select

from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.cell_counts import outcomes_of
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.judgements import latest_judgements
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import EventRow, RobotRow, SessionRow
from vsnbench.results.writing.entries import INTERVENTION
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.permutation import Stratum, stratified_permutation
from vsnbench.statistics.rates import Proportion

if TYPE_CHECKING:
    import pandas as pd


OperatorActivity = Mapping[str, Rows]
"""`sessions` in chronological order, and `operators` by name, as rows of the measures in `tables.operators`."""


def has_sessions(engine: Engine) -> bool:
    """Return whether a record has sessions of operators."""
    with record_errors(engine), engine.connect() as connection:
        return connection.scalar(select(SessionRow.id).limit(1)) is not None


def read_operator_activity(engine: Engine, record: ReportData) -> OperatorActivity | None:
    """Return the operators and sessions; None without operators, or with one operator in one session."""
    with record_errors(engine), engine.connect() as connection:
        rows = connection.execute(
            select(SessionRow.id, SessionRow.operator, RobotRow.title, SessionRow.began_at, SessionRow.ended_at)
            .join(RobotRow, RobotRow.id == SessionRow.robot_id)
            .where(SessionRow.id.in_([int(number) for number in record.episodes["session"].unique() if number]))
            .order_by(SessionRow.began_at, SessionRow.id)
        ).all()
        acted = connection.execute(
            select(EventRow.episode_id, EventRow.author).where(EventRow.kind == INTERVENTION)
        ).all()
    judged_by, overruled = _judged(engine)
    if len(rows) < 2 and not acted and not judged_by:
        return None
    known = dict(zip(record.episodes["episode"].tolist(), record.episodes["session"].tolist(), strict=True))
    interventions = [(known[episode], author) for episode, author in acted if episode in known]
    sessions = tuple(_session(record, row, sum(session == row.id for session, _ in interventions)) for row in rows)
    counted = record.counted()
    judges = counted["episode"].map(judged_by)
    names = (
        {session["operator"] for session in sessions}
        | set(judges.dropna())
        | {author for _, author in interventions if author}
    )
    if len(names) < 2 and len(sessions) < 2:
        return None
    ordered = sorted(names)
    found = [_chance(counted, judges, name) for name in ordered]
    asked = [p for p in found if p is not None]
    # With two operators both tests are the same.
    corrected = iter(asked if len(asked) <= 2 else holm(asked))
    operators = []
    for name, p in zip(ordered, found, strict=True):
        own = [session for session in sessions if session["operator"] == name]
        mine = counted[judges == name]
        operators.append(
            {
                "name": name,
                "sessions": len(own),
                "hours": sum(session["hours"] for session in own),
                "judged": outcomes_of(mine),
                "overruled": sum(overruled.get(number, False) for number in mine["episode"].tolist()),
                "interventions": sum(author == name for _, author in interventions),
                "p": None if p is None else next(corrected),
            }
        )
    return {"sessions": sessions, "operators": operators}


def _session(record: ReportData, row: Any, interventions: int) -> dict[str, Any]:
    mine = record.episodes[record.episodes["session"] == row.id]
    counted = record.counted()
    last = mine["ended_at"].max()
    ended_at = row.ended_at or (last.to_pydatetime() if last == last else row.began_at)
    return {
        "session": row.id,
        "operator": row.operator,
        "robot": row.title,
        "began_at": row.began_at,
        "ended_at": ended_at,
        "hours": max(0.0, (ended_at - row.began_at).total_seconds()) / 3600,
        "outcomes": outcomes_of(counted[counted["session"] == row.id]),
        "attempts": len(mine),
        "interventions": interventions,
    }


def _judged(engine: Engine) -> tuple[Mapping[int, str], Mapping[int, bool]]:
    """Return the judging operator of each judged episode, and whether the verdict overruled the protocol."""
    judgements = latest_judgements(engine)
    return (
        {number: last.author for number, (_, last) in judgements.items()},
        {number: first is not None and first.success != last.success for number, (first, last) in judgements.items()},
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
