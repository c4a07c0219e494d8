"""Who stood beside the robot, as sheets and as JSON values; nothing where it was one person in one session.

The columns that answer come first: a phone shows four.
"""

import math
from typing import Any

from vsnbench.report.attended import Attended
from vsnbench.report.sheets import (
    UNKNOWN,
    Cell,
    Column,
    Sheet,
    count,
    decimal,
    interval_percent,
    of,
    percent,
    row,
    word,
)
from vsnbench.report.verdicts import compared
from vsnbench.statistics.clustered import rate_interval


def operator_sheet(attended: Attended) -> Sheet:
    """Who judged what: successes, overruled estimates, interventions."""
    rows = []
    for one in attended.operators:
        judged, interval = one.judged.proportion, rate_interval(one.judged)
        rows.append(
            row(
                word(one.name),
                of(judged.successes, judged.trials),
                percent(judged.rate, 1),
                interval_percent(interval.low, interval.high, 1),
                Cell(UNKNOWN, -1.0) if one.p is None else Cell(compared(one.p).removeprefix("= "), one.p),
                count(one.overruled),
                count(one.interventions),
                count(one.sessions),
                decimal(one.hours, 2),
            )
        )
    return Sheet(
        name="operators",
        title="Who judged",
        columns=(
            Column("person", number=False),
            Column("judged k/n", note="successes of the trials that count by this person's verdict"),
            Column("SR %", rank=1),
            Column("95 % interval", rank=4),
            Column("p", note="of success having nothing to do with who judged, model for model and goal for goal"),
            Column("overruled", note="verdicts in which the protocol had said otherwise"),
            Column("interventions"),
            Column("sessions", rank=2),
            Column("hours", rank=3),
        ),
        rows=tuple(rows),
        notes=(
            "p: this person against the others, model for model and goal for goal, exact"
            + (", corrected for as many persons." if len(rows) > 2 else "."),
            "Who judged was not drawn by lot: a small p says that days or persons differ, not which verdict was wrong.",
        ),
    )


def session_sheet(attended: Attended) -> Sheet:
    """Every session with what was done in it."""
    return Sheet(
        name="sessions",
        title="Sessions",
        columns=(
            Column("session"),
            Column("operator", number=False),
            Column("k/n"),
            Column("SR %"),
            Column("interventions", rank=1),
            Column("began (UTC)", number=False),
            Column("hours"),
            Column("attempts", rank=2),
            Column("robot", number=False, rank=3),
        ),
        rows=tuple(
            row(
                count(one.number),
                word(one.operator),
                of(one.outcomes.proportion.successes, one.outcomes.proportion.trials),
                percent(one.outcomes.proportion.rate, 1),
                count(one.interventions),
                word(f"{one.began_at:%Y-%m-%d %H:%M}"),
                decimal(one.hours, 2),
                count(one.attempts),
                word(one.robot),
            )
            for one in attended.sessions
        ),
        notes=("One operator with one robot; k of the n trials that count.",),
    )


def attended_fields(attended: Attended | None) -> dict[str, Any] | None:
    """Return the same as JSON values; null where it was one person in one session."""
    if attended is None:
        return None
    return {
        "operators": [
            {
                "name": one.name,
                "sessions": one.sessions,
                "hours": one.hours,
                "judged": one.judged.proportion.trials,
                "successes": one.judged.proportion.successes,
                "success_rate": _finite(one.judged.proportion.rate),
                "ci_low": _finite(rate_interval(one.judged).low),
                "ci_high": _finite(rate_interval(one.judged).high),
                "overruled": one.overruled,
                "interventions": one.interventions,
                "p": one.p,
            }
            for one in attended.operators
        ],
        "sessions": [
            {
                "session": one.number,
                "operator": one.operator,
                "robot": one.robot,
                "began_at": one.began_at.isoformat(),
                "ended_at": one.ended_at.isoformat(),
                "attempts": one.attempts,
                "episodes": one.outcomes.proportion.trials,
                "successes": one.outcomes.proportion.successes,
                "interventions": one.interventions,
            }
            for one in attended.sessions
        ],
    }


def _finite(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None
