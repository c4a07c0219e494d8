"""Tables of end reasons, goals' definitions, robots' stability and models' actions."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.comparability import kinds_note
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.measures import COUNT, FLAG, NUMBERS, TEXT, Measure, Measures, decimals, percents
from vsnbench.report.table import Column, ReportTable, row
from vsnbench.results.goals import RecordedGoal
from vsnbench.results.reading.read_model import COUNTED, RUNNING
from vsnbench.results.writing.entries import END_REASONS
from vsnbench.text.sanitize import counted
from vsnbench.values.robot_identity import IMPORTED


def definition_table(goals: Mapping[str, RecordedGoal], results: ReportResults) -> ReportTable | None:
    """Return the definitions of the goals that are not categories; None if there is none."""
    used = sorted({goal for summary in results.conditions for goal in summary.own_goals if goal in goals})
    if not used:
        return None
    return ReportTable(
        name="goal-definitions",
        title="Goals that are not categories of objects",
        columns=(
            *(Column(heading, number=False) for heading in ("goal", "kind", "words", "targets")),
            Column("hash", number=False, note="beginning of the SHA-256 of the goal's definition"),
        ),
        rows=tuple(
            row(name, goals[name].kind, goals[name].text, goals[name].target_text, goals[name].sha256[:12])
            for name in used
        ),
    )


_NAMED = 12
"""Number of episodes that a note names."""
_RESULTS = {reason.value for reason in EndReason if reason.is_result}
MODEL = Measure("", TEXT, of="model", heading="model")
"""First column of tables with several conditions."""
ENDS = Measures(
    MODEL,
    Measure("end_reason", TEXT, END_REASONS, heading="end reason", note=""),
    Measure("attempts", COUNT, "number of ended episodes, void ones included", heading="attempts", note=""),
    Measure("counted", COUNT, "number of counted episodes among them", heading="counted", note=""),
    Measure("", percents(), of="share", heading="% of counted", rank=1),
    Measure("", TEXT, of="kind", heading="kind"),
)


def end_counts(summary: ConditionSummary) -> list[dict[str, Any]]:
    """Return the end reasons of a condition's episodes as rows of `ENDS`."""
    if (episodes := summary.total.attempts) is None:
        return []
    over, counted = ~episodes.state.of(RUNNING), episodes.state.of(COUNTED)
    order = [reason.value for reason in EndReason]
    rows = []
    for reason in [*order, *sorted(set(episodes.end_reason.names) - set(order))]:
        ended = episodes.end_reason.of(reason)
        if attempts := int((ended & over).sum()):
            results = int((ended & counted).sum())
            void = "void" if summary.condition.kind == IMPORTED else "void: run again"
            row = {"model": summary.condition.name, "end_reason": reason, "attempts": attempts, "counted": results}
            share = results / summary.total.episodes if results else None
            rows.append({**row, "share": share, "kind": "result" if reason in _RESULTS else void})
    return rows


def end_reason_table(results: ReportResults) -> ReportTable:
    """Return the number of episodes by end reason and condition."""
    names = footnotes([summary.condition for summary in results.conditions])
    rows = [row for summary in results.conditions for row in end_counts(summary)]
    return ENDS.table("ends", "How episodes ended", rows, footnotes=names)


def _robot(row: Mapping[str, Any]) -> str:
    return str(row.get("label") or f"{row['title'] or row['robot']}, {'simulated' if row['simulated'] else 'real'}")


def _failures_per_km(row: Mapping[str, Any]) -> float:
    return float(row["failures"] / (row["path_m"] / 1000)) if row["path_m"] > 0 else math.nan


_ALL = "all attempts, including void ones"
_DRIVING, _ELAPSED = "sum of the durations on the robot's clock", "time during which at least one process ran"
_SESSIONS = "from the first start to the last end of each session, hours"
_FAILED = "failed motion, lost sensor, model error, dead process"
_HELPED = "operator actions on a real robot, except placing it"
_HOURS, _KM = decimals(2, unit=3600), decimals(2, unit=1000)
ROBOTS = Measures(
    Measure("robot", TEXT, "name of the robot profile"),
    Measure("title", TEXT, "the robot's name for people"),
    Measure("simulated", FLAG, "the robot is simulated"),
    Measure("", TEXT, of=_robot, heading="robot"),
    Measure("episodes", COUNT, "number of episodes", heading="episodes", note=_ALL),
    Measure(
        "driving_s",
        _HOURS,
        _DRIVING,
        heading="driving h",
        note="sum of the episodes' durations on the robot's clock, hours",
    ),
    Measure("elapsed_s", _HOURS, _ELAPSED, heading="elapsed h", note=_SESSIONS, rank=2),
    Measure("path_m", _KM, "length of the driven paths", heading="km", note=""),
    Measure(
        "failures",
        COUNT,
        "episodes that ended with a failure of the system",
        heading="failures",
        note=_FAILED,
        rank=1,
    ),
    Measure("collisions", COUNT, "episodes that ended with a collision", heading="collisions", note="", rank=1),
    Measure(
        "interventions",
        COUNT,
        "interventions of operators; 0 for simulated robots",
        heading="interventions",
        note=_HELPED,
        rank=1,
    ),
    Measure(
        "failures_per_km",
        decimals(2),
        "`failures` per kilometre",
        _failures_per_km,
        null="without a path",
        heading="failures/km",
        note="",
    ),
).in_columns(
    *("robot", "driving h", "elapsed h", "km", "episodes", "interventions", "collisions", "failures", "failures/km")
)


def stability_table(robots: Rows) -> ReportTable:
    """Return driving time, distance and failures of each robot (paper, Table 6)."""
    rows = [ROBOTS.row(robot) for robot in robots]
    if len(robots) > 1:
        summed = ("driving_s", "elapsed_s", "path_m", "episodes", "interventions", "collisions", "failures")
        total = {name: sum(robot[name] for robot in robots) for name in summed}
        rows.append(ROBOTS.row({"label": "all", **total}, total=True))
    notes = ["All attempts, including void ones."]
    if any(robot["simulated"] for robot in robots):
        notes.append("Simulated robots: hours of simulated time, which can exceed the elapsed time.")
    return ReportTable("stability", "Stability", ROBOTS.columns, tuple(rows), tuple(notes))


def _middle(name: str, share: float = 0.5) -> Callable[[Mapping[str, Any]], float]:
    """Return the function that gives a quantile of a robot's list; NaN of an empty one."""

    def quantile(row: Mapping[str, Any]) -> float:
        return float(np.quantile(row[name], share)) if row[name] else math.nan

    return quantile


_UNMEASURED = "without measured poses after 1 m of path or more"
_PER_METRE = "distance between the pose by the odometry and the one measured after STOP, per metre of path"
_TURNED = "difference of the headings, radians per metre of path, median"
_DIFFER = "STOP succeeds by one of the two poses and fails by the other"
ODOMETRY = Measures(
    Measure("robot", TEXT, "name of the robot profile"),
    Measure("title", TEXT, "the robot's name for people"),
    Measure("simulated", FLAG, "the robot is simulated"),
    Measure("", TEXT, of=_robot, heading="robot"),
    Measure("stops", COUNT, "number of STOPs after which the pose was to be measured", heading="stops", note=""),
    Measure(
        "measured",
        COUNT,
        "STOPs whose images determine the pose",
        lambda row: len(row["drift_m"]),
        heading="measured",
    ),
    Measure(
        "drift_per_m",
        decimals(1, 100),
        f"{_PER_METRE}, median",
        _middle("drift_per_m"),
        null=_UNMEASURED,
        heading="drift cm/m",
        note=_PER_METRE,
    ),
    Measure(
        "drift_per_m_p95",
        decimals(1, 100),
        f"{_PER_METRE}, 95th percentile",
        _middle("drift_per_m", 0.95),
        null=_UNMEASURED,
        heading="95 %",
        rank=1,
    ),
    Measure("turn_per_m", decimals(2, 1), _TURNED, _middle("turn_per_m"), null=_UNMEASURED),
    Measure(
        "drift_m_max",
        decimals(2),
        "greatest distance between the pose by the odometry and the one measured after STOP, metres",
        _middle("drift_m", 1.0),
        null="without measured poses",
        heading="most m",
        rank=1,
    ),
    Measure("differing", NUMBERS, f"episodes in which {_DIFFER}"),
    Measure("", COUNT, of=lambda row: len(row["differing"]), heading="verdicts differ", note=_DIFFER),
)


def odometry_table(stops: Rows) -> ReportTable:
    """Return how far the odometry of each robot was off after STOP, by the poses measured from depth images."""
    notes = []
    for robot in stops:
        if differing := robot["differing"]:
            named = ", ".join(map(str, differing[:_NAMED]))
            more = f" and {len(differing) - _NAMED} more" if len(differing) > _NAMED else ""
            left = f"; {robot['unjudged']} of them await judgement" if robot["unjudged"] else ""
            trials = counted(len(differing), "trial")
            notes.append(f"{_robot(robot)}: the two poses give different verdicts of {trials}: {named}{more}{left}.")
    return ODOMETRY.table("odometry", "Odometry after STOP", stops, notes=tuple(notes))


def _executed(row: Mapping[str, Any]) -> str:
    return "blocked by the depth guard" if row["blocked"] else str(row["action"])


ACTIONS = Measures(
    MODEL,
    Measure("raw_action", TEXT, "action as the model named it", heading="model's action", note=""),
    Measure("action", TEXT, "action that the robot received"),
    Measure("blocked", FLAG, "the depth guard prevented the action"),
    Measure("", TEXT, of=_executed, heading="executed"),
    Measure("steps", COUNT, "number of steps", heading="steps", note=""),
    Measure("", percents(), of="share", heading="%"),
)


def action_table(results: ReportResults, actions: Rows) -> ReportTable:
    """Return how often each action was chosen and what was executed (paper, Figure 9)."""
    conditions = [summary.condition for summary in results.conditions]
    rows: list[Mapping[str, Any]] = []
    for condition in conditions:
        mine = [usage for usage in actions if usage["condition"] == condition.number]
        whole = sum(usage["steps"] for usage in mine)
        ordered = sorted(mine, key=lambda usage: (-usage["steps"], usage["raw_action"]))
        rows += [{**usage, "model": condition.name, "share": usage["steps"] / whole} for usage in ordered]
    notes = ("Counted episodes only.", *filter(None, [kinds_note(conditions)]))
    return ACTIONS.table("actions", "Actions by model", rows, notes=notes, footnotes=footnotes(conditions))
