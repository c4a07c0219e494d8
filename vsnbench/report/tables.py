"""The tables of a report as sheets: by goal, by starting position, by end reason."""

import math
from collections.abc import Sequence

from vsnbench.harmless_text import counted
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import TRIVIAL_M
from vsnbench.report.activity import ActionCount, RobotActivity
from vsnbench.report.conditions import footnotes
from vsnbench.report.record import goal_order
from vsnbench.report.sheets import (
    UNKNOWN,
    Cell,
    Column,
    Row,
    Sheet,
    count,
    decimal,
    interval_percent,
    listed,
    of,
    percent,
    row,
    word,
)
from vsnbench.report.summary import ConditionSummary, Results, Summary

_INTERVAL = (
    "Wilson's interval of the success rate at the effective sample size, percent; starting positions are clusters"
)
_RATES = (
    Column("k/n", note="successful episodes of episodes that count, one a trial"),
    Column("SR %", note="success rate (paper, Section 4.1)"),
    Column("95 % interval", note=_INTERVAL),
)
_MEASURES = (
    Column("actions", note="mean number of actions over all episodes: the paper's average"),
    Column("actions (succ.)", rank=1, note="mean number of actions over the successful episodes"),
    Column("SPL", rank=1, note="success weighted by path length, 0 to 1"),
    Column("SoftSPL", rank=4, note="the same with progress in place of success, 0 to 1"),
    Column("median d (m)", rank=3, note="median final distance to the nearest instance's footprint, metres"),
    Column("coll.", rank=3, note="episodes that ended with a collision"),
    Column("limit", rank=3, note="episodes that reached the cap on actions"),
)
_COVERAGE = (
    Column("done", note="trials done of trials planned"),
    Column("void", rank=2, note="attempts that were no result, counted beside"),
)


def overview_sheet(results: Results) -> Sheet:
    """Success rates of every condition by goal, a line each: the table for a paper's column."""
    goals = sorted({goal.goal for one in results.conditions for goal in one.goals}, key=goal_order)
    rows = []
    for one in results.conditions:
        known = {goal.goal: goal.summary for goal in one.goals}
        cells = [percent(known[goal].success_rate, 0) if goal in known else Cell(UNKNOWN, -math.inf) for goal in goals]
        total, interval = one.total, one.total.interval
        rows.append(
            row(
                word(one.condition.name),
                *cells,
                percent(total.success_rate, 1),
                interval_percent(interval.low, interval.high, 1),
                count(total.episodes),
            )
        )
    return Sheet(
        name="overview",
        title="Success rate by goal, percent",
        columns=(
            Column("model", number=False),
            *(Column(goal, rank=1) for goal in goals),
            Column("all"),
            Column("95 % interval", note="of all, percent"),
            Column("n", note="episodes that count, all goals"),
        ),
        rows=tuple(rows),
        footnotes=footnotes([one.condition for one in results.conditions]),
    )


def goal_sheet(one: ConditionSummary) -> Sheet:
    """Success by goal category under one condition (paper, Tables 4 and 5, with what they leave out)."""
    rows = [_summary_row(goal.goal, goal.summary) for goal in one.goals]
    rows.append(_summary_row("all", one.total, total=True))
    if one.shared:
        rows.append(_summary_row(f"shared: {listed(one.shared_goals)}", one.shared, total=True))
    return Sheet(
        name=f"goals-{one.condition.number}",
        title=f"{one.condition.name}: success by goal",
        columns=(Column("goal", number=False), *_RATES, *_MEASURES, *_COVERAGE),
        rows=tuple(rows),
        notes=(one.condition.description, *_caveats(one.total)),
        condition=one.condition.number,
    )


def start_sheet(one: ConditionSummary) -> Sheet:
    """Success by starting position under one condition, and which positions never succeed."""
    never = one.never_succeeding
    return Sheet(
        name=f"starts-{one.condition.number}",
        title=f"{one.condition.name}: success by starting position",
        columns=(Column("start"), *_RATES, *_MEASURES, *_COVERAGE),
        rows=tuple(
            Row((count(start.start), *_rates(start.summary), *_measures(start.summary), *_coverage(start.summary)))
            for start in one.starts
            if start.start > 0  # 0 is what an import knows no number for
        ),
        notes=(f"Positions that never succeed: {listed(never)}.",) if one.total.episodes else (),
        condition=one.condition.number,
    )


def end_sheet(results: Results) -> Sheet:
    """Why episodes ended, by condition."""
    rows = [
        row(
            word(one.condition.name),
            word(end.end_reason),
            count(end.attempts),
            count(end.counted),
            percent(end.counted / one.total.episodes if end.counted else float("nan")),
            word("result" if end.end_reason in _RESULTS else "void: run again"),
        )
        for one in results.conditions
        for end in one.ends
    ]
    return Sheet(
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
        footnotes=footnotes([one.condition for one in results.conditions]),
    )


def stability_sheet(robots: Sequence[RobotActivity]) -> Sheet:
    """How long and how far each robot drove, and how often it failed (paper, Table 6)."""
    rows = [
        _stability_row(f"{one.title or one.robot}, {'simulated' if one.simulated else 'real'}", one) for one in robots
    ]
    if len(robots) > 1:
        rows.append(_stability_row("all", *robots, total=True))
    return Sheet(
        name="stability",
        title="Stability",
        columns=(
            Column("robot", number=False),
            Column("driving h", note="sum of the episodes' durations on the robot's clock, hours"),
            Column("elapsed h", rank=2, note="from the first start to the last end of each session, hours"),
            Column("km"),
            Column("episodes", note="attempts, void ones too"),
            Column("interventions", rank=1, note="a person acted on a real robot outside the placing"),
            Column("collisions", rank=1),
            Column("failures", rank=1, note="failed motion, lost sensor, model error, dead process"),
            Column("failures/km"),
        ),
        rows=tuple(rows),
        notes=(
            "All attempts, void ones too: the robot drove in them.",
            *(
                ["A simulated robot's clock is the simulation's: it can drive for more hours than elapse."]
                if any(one.simulated for one in robots)
                else []
            ),
        ),
    )


def _stability_row(name: str, *robots: RobotActivity, total: bool = False) -> Row:
    metres, failures = sum(one.path_m for one in robots), sum(one.failures for one in robots)
    return row(
        word(name),
        decimal(sum(one.driving_s for one in robots) / 3600, 2),
        decimal(sum(one.elapsed_s for one in robots) / 3600, 2),
        decimal(metres / 1000, 2),
        count(sum(one.episodes for one in robots)),
        count(sum(one.interventions for one in robots)),
        count(sum(one.collisions for one in robots)),
        count(failures),
        decimal(failures / metres * 1000 if metres > 0 else float("nan"), 2),
        total=total,
    )


def action_sheet(results: Results, actions: Sequence[ActionCount]) -> Sheet:
    """How often each action was chosen, and what became of it (paper, Figure 9)."""
    rows = []
    for one in results.conditions:
        mine = [each for each in actions if each.condition == one.condition.number]
        whole = sum(each.steps for each in mine)
        rows += [
            row(
                word(one.condition.name),
                word(each.raw_action),
                word("blocked by the depth guard" if each.blocked else each.action),
                count(each.steps),
                percent(each.steps / whole),
            )
            for each in sorted(mine, key=lambda each: (-each.steps, each.raw_action))
        ]
    return Sheet(
        name="actions",
        title="Actions of the models, and what became of them",
        columns=(
            Column("model", number=False),
            Column("the model's action", number=False),
            Column("executed", number=False),
            Column("steps"),
            Column("%"),
        ),
        rows=tuple(rows),
        notes=("Over the episodes that count.",),
        footnotes=footnotes([one.condition for one in results.conditions]),
    )


_RESULTS = {reason.value for reason in EndReason if reason.is_result}


def _caveats(total: Summary) -> list[str]:
    episodes, trials = counted(total.episodes, "episode"), counted(total.planned, "planned trial")
    notes = [f"n = {episodes} of {trials} ({100 * total.coverage:.1f} %)."]
    if total.repeats:
        notes.append(f"{total.repeats}: repetitions of a cell are no new places, and the intervals know it.")
    if not total.episodes:
        notes.append("No trial of this condition is done yet.")
    elif total.episodes < total.planned:
        notes.append("Incomplete: the rates are of the trials done.")
    if total.unjudged:
        waiting = counted(total.unjudged, "episode awaits", "episodes await")
        notes.append(f"{waiting} a verdict, and no rate has them.")
    if total.successes and not total.spl_episodes:
        notes.append(f"SPL is not known: the path length of no success is ({total.successes} of them).")
    if 0 < total.spl_episodes < total.episodes:
        unknown = counted(total.episodes - total.spl_episodes, "success is", "successes are")
        known = counted(total.spl_episodes, "episode")
        notes.append(f"SPL is over {known}: the path length of {unknown} unknown.")
    if 0 < total.soft_spl_episodes < total.episodes:
        known = counted(total.soft_spl_episodes, "episode whose path length is", "episodes whose path lengths are")
        notes.append(f"SoftSPL is over the {known} known.")
    if total.trivial:
        began = counted(total.trivial, "episode is trivial: it began", "episodes are trivial: they began")
        notes.append(f"{began} within {TRIVIAL_M:g} m, one move, of success.")
    return notes


def _summary_row(name: str, summary: Summary, *, total: bool = False) -> Row:
    return Row((word(name), *_rates(summary), *_measures(summary), *_coverage(summary)), total)


def _rates(summary: Summary) -> tuple[Cell, ...]:
    interval = summary.interval
    return (
        of(summary.successes, summary.episodes),
        percent(summary.success_rate),
        interval_percent(interval.low, interval.high),
    )


def _measures(summary: Summary) -> tuple[Cell, ...]:
    return (
        decimal(summary.mean_actions, 1),
        decimal(summary.mean_actions_successful, 1),
        decimal(summary.spl, 3),
        decimal(summary.soft_spl, 3),
        decimal(summary.median_distance_m, 2),
        count(summary.collisions),
        count(summary.step_limits),
    )


def _coverage(summary: Summary) -> tuple[Cell, ...]:
    return (of(summary.episodes, summary.planned), count(summary.void))
