"""Operators and sessions as tables and JSON values.

The most important columns come first, because a phone shows four.
"""

import math
from typing import Any

from vsnbench.report.analysis.fields import finite, interval_fields
from vsnbench.report.analysis.operators import OperatorActivity
from vsnbench.report.table import Column, ReportTable, decimal, of, p_cell, percent, rate_cells, row
from vsnbench.statistics.clustered import rate_interval


def operator_table(operator_activity: OperatorActivity) -> ReportTable:
    """Return the table of operators: judged trials, successes, overruled estimates, interventions."""
    return ReportTable(
        name="operators",
        title="Operators",
        columns=(
            Column("operator", number=False),
            Column("judged k/n", note="successes of the counted trials that this operator judged"),
            Column("SR %", rank=1),
            Column("95 % interval", rank=4),
            Column("p", note="of no association between success and operator, stratified by model and goal"),
            Column("overruled", note="verdicts that differ from the protocol's estimate"),
            Column("interventions"),
            Column("sessions", rank=2),
            Column("hours", rank=3),
        ),
        rows=tuple(
            row(
                operator.name,
                *rate_cells(operator.judged.proportion, rate_interval(operator.judged), 1),
                p_cell(math.nan if operator.p is None else operator.p),
                operator.overruled,
                operator.interventions,
                operator.sessions,
                decimal(operator.hours, 2),
            )
            for operator in operator_activity.operators
        ),
        notes=(
            "p: this operator against the others, stratified by model and goal, exact"
            + (", Holm-corrected for the number of operators." if len(operator_activity.operators) > 2 else "."),
            "Operators were not assigned at random: a small p shows that days or operators differ, not who was wrong.",
        ),
    )


def session_table(operator_activity: OperatorActivity) -> ReportTable:
    """Return the table of sessions."""
    return ReportTable(
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
                session.number,
                session.operator,
                of(session.outcomes.proportion.successes, session.outcomes.proportion.trials),
                percent(session.outcomes.proportion.rate, 1),
                session.interventions,
                f"{session.began_at:%Y-%m-%d %H:%M}",
                decimal(session.hours, 2),
                session.attempts,
                session.robot,
            )
            for session in operator_activity.sessions
        ),
        notes=("One operator with one robot; k successes in n counted trials.",),
    )


def operator_fields(operator_activity: OperatorActivity | None) -> dict[str, Any] | None:
    """Return the operators and sessions as JSON values; null with one operator in one session."""
    if operator_activity is None:
        return None
    return {
        "operators": [
            {
                "name": operator.name,
                "sessions": operator.sessions,
                "hours": operator.hours,
                "judged": operator.judged.proportion.trials,
                "successes": operator.judged.proportion.successes,
                "success_rate": finite(operator.judged.proportion.rate),
                **interval_fields(rate_interval(operator.judged)),
                "overruled": operator.overruled,
                "interventions": operator.interventions,
                "p": operator.p,
            }
            for operator in operator_activity.operators
        ],
        "sessions": [
            {
                "session": session.number,
                "operator": session.operator,
                "robot": session.robot,
                "began_at": session.began_at.isoformat(),
                "ended_at": session.ended_at.isoformat(),
                "attempts": session.attempts,
                "episodes": session.outcomes.proportion.trials,
                "successes": session.outcomes.proportion.successes,
                "interventions": session.interventions,
            }
            for session in operator_activity.sessions
        ],
    }
