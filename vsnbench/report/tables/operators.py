"""Operators and sessions.

The most important columns come first, because a phone shows four.
"""

from collections.abc import Mapping
from typing import Any

from vsnbench.report.analysis.operators import OperatorActivity
from vsnbench.report.measures import (
    COUNT,
    RATIO,
    TEXT,
    Form,
    Measure,
    Measures,
    P,
    intervals,
    objects,
    percents,
)
from vsnbench.report.table import ReportTable, TableCell, decimal
from vsnbench.statistics.clustered import rate_interval
from vsnbench.statistics.rates import Proportion


def _judged(operator: Mapping[str, Any]) -> Proportion:
    proportion: Proportion = operator["judged"].proportion
    return proportion


def _of_session(session: Mapping[str, Any]) -> Proportion:
    proportion: Proportion = session["outcomes"].proportion
    return proportion


_HOURS = Form({"type": "number"}, lambda hours: decimal(hours, 2))
_P = "p-value of no association between success and operator"
_P_NOTE = "of no association between success and operator, stratified by model and goal"
_K_OF_N = "successes of the counted trials that this operator judged"
OPERATORS = Measures(
    Measure("name", TEXT, "name of the operator", heading="operator", note=""),
    Measure("sessions", COUNT, "number of sessions", heading="sessions", note="", rank=2),
    Measure("hours", _HOURS, "duration of the sessions in hours", heading="hours", note="", rank=3),
    Measure("judged", COUNT, "counted episodes that the operator judged", lambda row: _judged(row).trials),
    Measure("successes", COUNT, "successes among them", lambda row: _judged(row).successes),
    Measure("", RATIO, _K_OF_N, lambda row: (_judged(row).successes, _judged(row).trials), heading="judged k/n"),
    Measure(
        "success_rate",
        percents(1),
        "share of successes",
        lambda row: _judged(row).rate,
        null="without episodes",
        heading="SR %",
        note="",
        rank=1,
    ),
    Measure(
        "ci",
        intervals(1),
        "its 95 % interval",
        lambda row: rate_interval(row["judged"]),
        heading="95 % interval",
        note="",
        rank=4,
    ),
    Measure("overruled", COUNT, "verdicts that differ from the protocol's estimate", heading="overruled"),
    Measure("interventions", COUNT, "the operator's interventions", heading="interventions", note=""),
    Measure("p", P, _P, heading="p", note=_P_NOTE),
).in_columns(
    *("operator", "judged k/n", "SR %", "95 % interval", "p", "overruled", "interventions", "sessions", "hours")
)
_BEGAN = Form({"type": "string"}, lambda at: TableCell(f"{at:%Y-%m-%d %H:%M}"), number=False)
SESSIONS = Measures(
    Measure("session", COUNT, "number of the session", heading="session", note=""),
    Measure("operator", TEXT, "name of the operator", heading="operator", note=""),
    Measure("robot", TEXT, "name of the robot profile", heading="robot", note="", rank=3),
    Measure("began_at", _BEGAN, "time of the beginning", heading="began (UTC)", note=""),
    Measure("ended_at", TEXT, "time of the end, or of the last activity"),
    Measure("attempts", COUNT, "number of episodes, void ones included", heading="attempts", note="", rank=2),
    Measure("episodes", COUNT, "number of counted episodes", lambda row: _of_session(row).trials),
    Measure("successes", COUNT, "successes among the counted episodes", lambda row: _of_session(row).successes),
    Measure(
        "interventions",
        COUNT,
        "the operator's interventions in the session",
        heading="interventions",
        note="",
        rank=1,
    ),
    Measure("", RATIO, of=lambda row: (_of_session(row).successes, _of_session(row).trials), heading="k/n"),
    Measure("", percents(1), of=lambda row: _of_session(row).rate, heading="SR %"),
    Measure("", _HOURS, of="hours", heading="hours"),
).in_columns(*("session", "operator", "k/n", "SR %", "interventions", "began (UTC)", "hours", "attempts", "robot"))
ACTIVITY = Measures(
    Measure("operators", objects(OPERATORS), "one object per operator"),
    Measure("sessions", objects(SESSIONS), "one object per session"),
)
"""The JSON object of operators and sessions."""


def operator_table(operator_activity: OperatorActivity) -> ReportTable:
    """Return the table of operators: judged trials, successes, overruled estimates, interventions."""
    operators = operator_activity["operators"]
    corrected = ", Holm-corrected for the number of operators." if len(operators) > 2 else "."
    notes = (
        f"p: this operator against the others, stratified by model and goal, exact{corrected}",
        "Operators were not assigned at random: a small p shows that days or operators differ, not who was wrong.",
    )
    return OPERATORS.table("operators", "Operators", operators, notes=notes)


def session_table(operator_activity: OperatorActivity) -> ReportTable:
    """Return the table of sessions."""
    notes = ("One operator with one robot; k successes in n counted trials.",)
    return SESSIONS.table("sessions", "Sessions", operator_activity["sessions"], notes=notes)
