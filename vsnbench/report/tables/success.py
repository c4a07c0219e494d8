"""Tables of success by goal, starting position and end reason; stability and actions."""

from collections.abc import Mapping, Sequence

from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import TRIVIAL_M
from vsnbench.report.analysis.activity import ActionCount, RobotActivity
from vsnbench.report.analysis.conditions import footnotes, kinds_note
from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.analysis.summary import ConditionSummary, Results, Summary
from vsnbench.report.tables.headline import headlines
from vsnbench.report.tables.report_table import (
    EMPTY,
    Column,
    ReportTable,
    Row,
    decimal,
    goal_distance,
    interval_percent,
    of,
    percent,
    rate_cells,
    row,
)
from vsnbench.report.wording import listed
from vsnbench.results.goals import RecordedGoal
from vsnbench.results.writing.imports import IMPORTED
from vsnbench.text.sanitize import counted

_COLUMNS = (
    Column("k/n", note="successful episodes of counted episodes, one per trial"),
    Column("SR %", note="success rate (paper, Section 4.1)"),
    Column(
        "95 % interval",
        note="Wilson's interval of the success rate at the effective sample size, percent; clustered by starting "
        "position",
    ),
    Column("actions", note="mean number of actions over all counted episodes, as in the paper"),
    Column("actions (succ.)", rank=1, note="mean number of actions over the successful episodes"),
    Column("SPL", rank=1, note="success weighted by path length, 0 to 1"),
    Column("SoftSPL", rank=4, note="SPL with progress instead of success, 0 to 1"),
    Column("SCT", rank=4, note="success weighted by completion time, 0 to 1"),
    Column("median d (m)", rank=3, note="median final distance to the nearest instance's footprint, metres"),
    Column("coll.", rank=3, note="episodes that ended with a collision"),
    Column("limit", rank=3, note="episodes that reached a limit on actions, time or path"),
    Column("done", note="completed trials of planned trials"),
    Column("void", rank=2, note="void attempts, not counted in any rate"),
)
"""Columns of `_summary_row` after the first."""


def overview_table(results: Results) -> ReportTable:
    """Return the success rates of all conditions by goal, one row per condition."""
    goals = sorted({goal.goal for summary in results.conditions for goal in summary.goals}, key=goal_order)
    shown = headlines(results.conditions)
    label = shown.label
    if len(goals) == 1:  # its column would equal that of the total
        label, goals = goals[0], []
    rows = []
    for summary, headline in zip(results.conditions, shown.by_condition, strict=True):
        known = {goal.goal: goal.summary for goal in summary.goals}
        cells = [percent(known[goal].success_rate, 0) if goal in known else EMPTY for goal in goals]
        total = headline.summary
        rate = (percent(total.success_rate, 1), interval_percent(total.interval, 1), total.episodes)
        rows.append(row(summary.condition.name, *cells, *rate))
    return ReportTable(
        name="overview",
        title="Success rate by goal, percent",
        columns=(
            Column("model", number=False),
            *(Column(goal, rank=1) for goal in goals),
            Column(label, note=f"over {shown.description}"),
            Column("95 % interval", note=f"over {shown.description}, percent"),
            Column("n", note=f"counted episodes, {shown.description}"),
        ),
        rows=tuple(rows),
        notes=() if shown.label == "all" else (f"Column `{shown.label}`: over {shown.description}.",),
        footnotes=footnotes([summary.condition for summary in results.conditions]),
    )


def goal_table(summary: ConditionSummary) -> ReportTable:
    """Return success by goal under one condition (paper, Tables 4 and 5)."""
    success_m = summary.condition.success_distance_m
    rows = [_summary_row(goal.title, goal.summary, success_m) for goal in summary.goals]
    totals = [(f"{kind} goals", total) for kind, total in summary.kinds.items()]
    if len(summary.goals) != 1:  # the total of one goal is its row
        totals.append(("all", summary.total))
    if summary.shared and len(summary.goals) > 1:
        totals.append((f"shared: {listed(summary.shared_goals)}", summary.shared))
    rows += [_summary_row(name, total, success_m, total=True) for name, total in totals]
    return ReportTable(
        name=f"goals-{summary.condition.number}",
        title=f"{summary.condition.name}: success by goal",
        columns=(Column("goal", number=False), *_COLUMNS),
        rows=tuple(rows),
        notes=(summary.condition.description, *_caveats(summary.total)),
        condition=summary.condition.number,
    )


def definition_table(goals: Mapping[str, RecordedGoal], results: Results) -> ReportTable | None:
    """Return the definitions of the goals that are not categories; None if there is none."""
    used = sorted({goal.goal for summary in results.conditions for goal in summary.goals if goal.goal in goals})
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


def start_table(summary: ConditionSummary) -> ReportTable:
    """Return success by starting position under one condition."""
    never = summary.never_succeeding
    return ReportTable(
        name=f"starts-{summary.condition.number}",
        title=f"{summary.condition.name}: success by starting position",
        columns=(Column("start"), *_COLUMNS),
        rows=tuple(
            _summary_row(start, mine, summary.condition.success_distance_m)
            for start, mine in summary.starts.items()
            if start > 0
        ),
        notes=(f"Positions without a success: {listed(never)}.",) if summary.total.episodes else (),
        condition=summary.condition.number,
    )


def end_reason_table(results: Results) -> ReportTable:
    """Return the number of episodes by end reason and condition."""
    rows = [
        row(
            summary.condition.name,
            end.end_reason,
            end.attempts,
            end.counted,
            percent(end.counted / summary.total.episodes if end.counted else float("nan")),
            "result"
            if end.end_reason in _RESULTS
            else "void"
            if summary.condition.kind == IMPORTED
            else "void: run again",
        )
        for summary in results.conditions
        for end in summary.ends
    ]
    return ReportTable(
        name="ends",
        title="How episodes ended",
        columns=(
            Column("model", number=False),
            Column("end reason", number=False),
            Column("attempts"),
            Column("counted"),
            Column("% of counted", rank=1),
            Column("kind", number=False),
        ),
        rows=tuple(rows),
        footnotes=footnotes([summary.condition for summary in results.conditions]),
    )


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


_RESULTS = {reason.value for reason in EndReason if reason.is_result}


def _caveats(total: Summary) -> list[str]:
    episodes, trials = counted(total.episodes, "episode"), counted(total.planned, "planned trial")
    notes = [f"n = {episodes} of {trials} ({100 * total.coverage:.1f} %)."]
    if total.repeats:
        notes.append(f"{total.repeats}; the intervals account for repetitions of a cell.")
    if not total.episodes:
        notes.append("No trial of this condition is complete.")
    elif total.episodes < total.planned:
        notes.append("Incomplete: the rates cover the completed trials only.")
    if total.unjudged:
        waiting = counted(total.unjudged, "episode awaits", "episodes await")
        notes.append(f"{waiting} a verdict and no rate includes them.")
    if total.successes and not total.spl_episodes:
        notes.append(f"SPL is unknown: no successful episode has a recorded path length (n = {total.successes}).")
    if 0 < total.spl_episodes < total.episodes:
        unknown = counted(total.episodes - total.spl_episodes, "success is", "successes are")
        known = counted(total.spl_episodes, "episode")
        notes.append(f"SPL is over {known}; the path length of {unknown} unknown.")
    if 0 < total.soft_spl_episodes < total.episodes:
        known = counted(total.soft_spl_episodes, "episode")
        notes.append(f"SoftSPL is over {known} with known path length.")
    if total.spl_episodes and total.successes and not total.sct_episodes:
        notes.append(f"SCT is unknown: no successful episode has a recorded time (n = {total.successes}).")
    if 0 < total.sct_episodes < total.episodes:
        notes.append(f"SCT is over {counted(total.sct_episodes, 'episode')} with known time.")
    if total.trivial:
        began = counted(total.trivial, "episode is trivial: it began", "episodes are trivial: they began")
        notes.append(f"{began} within {TRIVIAL_M:g} m (one move) of success.")
    return notes


def _summary_row(name: str | int, summary: Summary, success_m: float | None, *, total: bool = False) -> Row:
    return row(
        name,
        *rate_cells(summary.proportion, summary.interval),
        decimal(summary.mean_actions, 1),
        decimal(summary.mean_actions_successful, 1),
        decimal(summary.spl, 3),
        decimal(summary.soft_spl, 3),
        decimal(summary.sct, 3),
        goal_distance(summary.median_distance_m, success_m),
        summary.collisions,
        summary.limits,
        of(summary.episodes, summary.planned),
        summary.void,
        total=total,
    )
