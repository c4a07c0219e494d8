"""Tables of end reasons, goals' definitions, robots' stability and models' actions."""

from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any

from vsnbench.protocol.judge import EndReason
from vsnbench.report.analysis.activity import ActionCount, RobotActivity
from vsnbench.report.analysis.conditions import footnotes, kinds_note
from vsnbench.report.analysis.summary import ConditionSummary, Results
from vsnbench.report.measures import COUNT, TEXT, Measure, Measures, percents
from vsnbench.report.table import Column, ReportTable, Row, decimal, percent, row
from vsnbench.results.goals import RecordedGoal
from vsnbench.results.reading.read_model import COUNTED, RUNNING
from vsnbench.results.writing.imports import IMPORTED


def definition_table(goals: Mapping[str, RecordedGoal], results: Results) -> ReportTable | None:
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


_RESULTS = {reason.value for reason in EndReason if reason.is_result}
_END_REASON = "`stop`, `step_limit`, `time_limit`, `path_limit`, `collision`, or a reason of a void episode"
MODEL = Measure("", TEXT, of=itemgetter("model"), heading="model")
"""First column of tables with several conditions."""
ENDS = Measures(
    (
        MODEL,
        Measure("end_reason", TEXT, _END_REASON, heading="end reason", note=""),
        Measure("attempts", COUNT, "number of ended episodes, void ones included", heading="attempts", note=""),
        Measure("counted", COUNT, "number of counted episodes among them", heading="counted", note=""),
        Measure("", percents(), of=itemgetter("share"), heading="% of counted", rank=1),
        Measure("", TEXT, of=itemgetter("kind"), heading="kind"),
    )
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


def end_reason_table(results: Results) -> ReportTable:
    """Return the number of episodes by end reason and condition."""
    names = footnotes([summary.condition for summary in results.conditions])
    rows = [row for summary in results.conditions for row in end_counts(summary)]
    return ENDS.table("ends", "How episodes ended", rows, footnotes=names)


def stability_table(robots: Sequence[RobotActivity]) -> ReportTable:
    """Return driving time, distance and failures of each robot (paper, Table 6)."""
    rows = [
        _stability_row(f"{robot.title or robot.robot}, {'simulated' if robot.simulated else 'real'}", robot)
        for robot in robots
    ]
    if len(robots) > 1:
        rows.append(_stability_row("all", *robots, total=True))
    return ReportTable(
        name="stability",
        title="Stability",
        columns=(
            Column("robot", number=False),
            Column("driving h", note="sum of the episodes' durations on the robot's clock, hours"),
            Column("elapsed h", rank=2, note="from the first start to the last end of each session, hours"),
            Column("km"),
            Column("episodes", note="all attempts, including void ones"),
            Column("interventions", rank=1, note="operator actions on a real robot, except placing it"),
            Column("collisions", rank=1),
            Column("failures", rank=1, note="failed motion, lost sensor, model error, dead process"),
            Column("failures/km"),
        ),
        rows=tuple(rows),
        notes=(
            "All attempts, including void ones.",
            *(
                ["Simulated robots: hours of simulated time, which can exceed the elapsed time."]
                if any(robot.simulated for robot in robots)
                else []
            ),
        ),
    )


def _stability_row(name: str, *robots: RobotActivity, total: bool = False) -> Row:
    metres, failures = sum(robot.path_m for robot in robots), sum(robot.failures for robot in robots)
    return row(
        name,
        decimal(sum(robot.driving_s for robot in robots) / 3600, 2),
        decimal(sum(robot.elapsed_s for robot in robots) / 3600, 2),
        decimal(metres / 1000, 2),
        sum(robot.episodes for robot in robots),
        sum(robot.interventions for robot in robots),
        sum(robot.collisions for robot in robots),
        failures,
        decimal(failures / metres * 1000 if metres > 0 else float("nan"), 2),
        total=total,
    )


def action_table(results: Results, actions: Sequence[ActionCount]) -> ReportTable:
    """Return how often each action was chosen and what was executed (paper, Figure 9)."""
    rows = []
    for summary in results.conditions:
        mine = [usage for usage in actions if usage.condition == summary.condition.number]
        whole = sum(usage.steps for usage in mine)
        rows += [
            row(
                summary.condition.name,
                usage.raw_action,
                "blocked by the depth guard" if usage.blocked else usage.action,
                usage.steps,
                percent(usage.steps / whole),
            )
            for usage in sorted(mine, key=lambda usage: (-usage.steps, usage.raw_action))
        ]
    return ReportTable(
        name="actions",
        title="Actions by model",
        columns=(
            Column("model", number=False),
            Column("model's action", number=False),
            Column("executed", number=False),
            Column("steps"),
            Column("%"),
        ),
        rows=tuple(rows),
        notes=(
            "Counted episodes only.",
            *filter(None, [kinds_note(summary.condition for summary in results.conditions)]),
        ),
        footnotes=footnotes([summary.condition for summary in results.conditions]),
    )
