"""Success by goal and starting position: the measures of a group of episodes, and their tables."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsnbench.protocol.execution import STACK
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import TRIVIAL_M
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.analysis.summary import ConditionSummary, Group, ReportResults
from vsnbench.report.measures import (
    COUNT,
    KNOWN_COUNT,
    NUMBER,
    RATIO,
    TEXT,
    Form,
    Measure,
    Measures,
    decimals,
    intervals,
    percents,
)
from vsnbench.report.table import EMPTY, Column, ReportTable, TableCell, goal_distance, interval_percent, percent, row
from vsnbench.report.tables.headline import headlines
from vsnbench.report.wording import listed
from vsnbench.results.reading.read_model import UNJUDGED, VOID
from vsnbench.text.sanitize import counted

_Values = Callable[[Group, str], NDArray[Any]]


def _values(group: Group, name: str) -> NDArray[Any]:
    """Return the known values of a column of the counted episodes."""
    values: NDArray[Any] = np.empty(0) if group.counted is None else getattr(group.counted, name)
    return np.asarray(values[~np.isnan(values)])


def _successful(group: Group, name: str) -> NDArray[Any]:
    """Return the known values of a column of the successful episodes."""
    if (episodes := group.counted) is None:
        return np.empty(0)
    values: NDArray[Any] = getattr(episodes, name)
    return np.asarray(values[episodes.success & ~np.isnan(values)])


def _weighted(group: Group, name: str) -> NDArray[Any]:
    """Return the known values of a column that is 0 for failures; none if it is unknown for all successes.

    The zeros of the failures alone would be misleading.
    """
    values = _values(group, name)
    return values[:0] if group.successes and not len(_successful(group, name)) else values


def ordered_mean(numbers: NDArray[Any]) -> float:
    """Return the mean, bit for bit independent of the order of the episodes; NaN of nothing."""
    return float(np.sort(numbers).mean()) if len(numbers) else math.nan


def _mean_of(name: str, values: _Values = _values) -> Callable[[Group], float]:
    """Return the function for the mean of a column."""
    return lambda group: ordered_mean(values(group, name))


def _number_of(name: str, values: _Values = _values) -> Callable[[Group], int]:
    """Return the function for the number of known values of a column."""
    return lambda group: len(values(group, name))


def _ended(*reasons: EndReason) -> Callable[[Group], int | None]:
    """Return the function for the number of episodes that ended for some reasons; None if unknown."""
    names = [reason.value for reason in reasons]
    return lambda group: None if group.counted is None else int(group.counted.end_reason.of(*names).sum())


def _attempts(state: str) -> Callable[[Group], int | None]:
    """Return the function for the number of attempts in a state; None if unknown."""
    return lambda group: None if group.attempts is None else int(group.attempts.state.of(state).sum())


def _mean_actions(group: Group) -> float:
    return group.published_actions if group.counted is None else _mean_of("actions")(group)


def _median_distance_m(group: Group) -> float:
    distances_m = _values(group, "distance_m")
    return float(np.median(distances_m)) if len(distances_m) else math.nan


def _oracle_success(group: Group) -> float:
    known = hasattr(group.counted, "oracle_success")  # of a record with a stack (`courses.with_stacks`)
    return ordered_mean(_values(group, "oracle_success")) if known else math.nan


def _interventions(group: Group) -> int | None:
    numbers = getattr(group.attempts, "interventions", np.empty(0))
    return int(known.sum()) if len(known := numbers[~np.isnan(numbers)]) else None


def _trivial(group: Group) -> int | None:
    return None if group.counted is None else int((_values(group, "shortest_m") < TRIVIAL_M).sum())


_LIMITS = {EndReason.STEP_LIMIT: "actions", EndReason.TIME_LIMIT: "time", EndReason.PATH_LIMIT: "the path"}
_OF_RATE = "the 95 % interval of the success rate"
_WILSON = "Wilson's interval of the success rate at the effective sample size, percent; clustered by starting position"
_K_OF_N, _DONE = "successful episodes of counted episodes, one per trial", "completed trials of planned trials"
_MEAN_ACTIONS = "mean number of actions over all counted episodes, as in the paper"
_NO_STACK = "unless a stack drives itself"
_LIMIT = "episodes that reached a limit on actions, time or path"
SUMMARY = Measures(
    Measure("successes", COUNT, "number of successes"),
    Measure("episodes", COUNT, "number of counted episodes, one per trial"),
    Measure("planned", COUNT, "number of planned trials"),
    Measure("coverage", NUMBER, "counted episodes divided by planned trials", null="without planned trials"),
    Measure("void", KNOWN_COUNT, "number of void episodes, which do not count", _attempts(VOID)),
    Measure("unjudged", COUNT, "episodes that await a verdict", lambda group: _attempts(UNJUDGED)(group) or 0),
    Measure("", RATIO, _K_OF_N, lambda group: (group.successes, group.episodes), heading="k/n"),
    Measure("success_rate", percents(), "success rate (paper, Section 4.1)", heading="SR %"),
    Measure("ci", intervals(), _OF_RATE, "interval", heading="95 % interval", note=_WILSON),
    Measure("mean_actions", decimals(1), _MEAN_ACTIONS, _mean_actions, heading="actions"),
    Measure(
        *("mean_actions_successful", decimals(1), "mean number of actions over the successful episodes"),
        *(_mean_of("actions", _successful),),
        heading="actions (succ.)",
        rank=3,
    ),
    Measure(
        "spl",
        decimals(3),
        "success weighted by path length, 0 to 1",
        _mean_of("spl", _weighted),
        heading="SPL",
        rank=1,
    ),
    Measure(
        "soft_spl",
        decimals(3),
        "SPL with progress instead of success, 0 to 1",
        _mean_of("soft_spl"),
        heading="SoftSPL",
        rank=4,
    ),
    Measure("spl_episodes", COUNT, "number of episodes in `spl`", _number_of("spl", _weighted)),
    Measure("soft_spl_episodes", COUNT, "number of episodes in `soft_spl`", _number_of("soft_spl")),
    Measure("progress", decimals(3), "mean covered share of the shortest path, 0 to 1", _mean_of("progress")),
    Measure("progress_episodes", COUNT, "number of episodes in `progress`", _number_of("progress")),
    Measure(
        "sct",
        decimals(3),
        "success weighted by completion time, 0 to 1",
        _mean_of("sct", _weighted),
        heading="SCT",
        rank=4,
    ),
    Measure("sct_episodes", COUNT, "number of episodes in `sct`", _number_of("sct", _weighted)),
    Measure(
        "oracle_success",
        percents(),
        "share of the examined episodes in which STOP would have succeeded at any pose",
        _oracle_success,
        heading="oracle SR %",
        null=_NO_STACK,
        rank=2,
    ),
    Measure(
        "interventions",
        COUNT,
        "number of recorded interventions, of void episodes too",
        _interventions,
        heading="interv.",
        null=_NO_STACK,
        rank=3,
    ),
    Measure("mean_driving_s", decimals(1), "mean duration on the robot's clock", _mean_of("duration_s")),
    Measure("mean_thinking_s", decimals(1), "mean inference time, on a real robot", _mean_of("thinking_s")),
    Measure("median_distance_to_goal_m", NUMBER, "median distance to the goal at the end", _median_distance_m),
    Measure(
        *("", Form({}, lambda at: goal_distance(*at))),
        "median final distance to the nearest instance's footprint, metres",
        lambda group: (_median_distance_m(group), group.success_distance_m),
        heading="median d (m)",
        rank=1,
    ),
    Measure(
        "collisions",
        KNOWN_COUNT,
        "episodes that ended with a collision",
        _ended(EndReason.COLLISION),
        heading="coll.",
        rank=3,
    ),
    *(
        Measure(f"{reason}s", KNOWN_COUNT, f"episodes that ended at the limit of {of}", _ended(reason))
        for reason, of in _LIMITS.items()
    ),
    Measure("", COUNT, _LIMIT, _ended(*_LIMITS), heading="limit", rank=3),
    Measure("trivial", KNOWN_COUNT, "episodes that began within one move of success", _trivial),
    Measure("cells", COUNT, "number of cells (goal and starting position)", lambda group: len(group.outcomes.cells)),
    Measure("", RATIO, _DONE, lambda group: (group.episodes, group.planned), heading="done", rank=2),
    Measure("", COUNT, "void attempts, not counted in any rate", _attempts(VOID), heading="void", rank=2),
)
"""Measures of a `Group`: columns of the success tables, and fields of CSV and JSON. A new column is one entry."""
_OF_STACKS = SUMMARY.in_columns(
    *(measure.heading for measure in SUMMARY.shown if not measure.key.startswith("mean_actions"))
)
"""The same for a stack that drives itself, which has no actions."""
_OF_MODELS = SUMMARY.in_columns(
    *(measure.heading for measure in SUMMARY.shown if measure.key not in ("oracle_success", "interventions"))
)
"""The same for a model: its oracle success is among the courses, as it takes long to compute."""
_KIND = "kind of the goal: `category`, `text`, `image` or `instruction`"
GROUP = Measures.shared(
    "summary",
    Measure("goal", TEXT, "name of the goal", only_in="`goals`"),
    Measure("kind", TEXT, _KIND, only_in="`goals` and `goal_kinds`"),
    Measure("start", COUNT, "number of the starting position", only_in="`starts`"),
    *SUMMARY,
)
"""The JSON object of a group."""


def overview_table(results: ReportResults) -> ReportTable:
    """Return the success rates of all conditions by goal, one row per condition."""
    goals = sorted({goal for summary in results.conditions for goal in summary.own_goals}, key=goal_order)
    shown = headlines(results.conditions)
    label = shown.label
    if len(goals) == 1:  # its column would equal that of the total
        label, goals = goals[0], []
    rows = []
    for summary, (_, total) in zip(results.conditions, shown.by_condition, strict=True):
        known = {group.goal: group for group in summary.goals}
        cells = [percent(known[goal].success_rate, 0) if goal in known else EMPTY for goal in goals]
        rate = (percent(total.success_rate, 1), interval_percent(total.interval, 1), total.episodes)
        name = summary.condition.name
        rows.append(row(f"{name} (person)" if summary.condition.driver else name, *cells, *rate))
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
    measures = _measures_of(summary)
    rows = [measures.row(group, TableCell(group.title)) for group in summary.goals]
    totals = [(f"{group.kind} goals", group) for group in summary.kinds]
    if len(summary.goals) != 1:  # the total of one goal is its row
        totals.append(("all", summary.total))
    if summary.shared and len(summary.goals) > 1:
        totals.append((f"shared: {listed(summary.shared_goals)}", summary.shared))
    rows += [measures.row(group, TableCell(name), total=True) for name, group in totals]
    return ReportTable(
        name=f"goals-{summary.condition.number}",
        title=f"{summary.condition.name}: success by goal",
        columns=(Column("goal", number=False), *measures.columns),
        rows=tuple(rows),
        notes=(summary.condition.description, *_caveats(summary.total)),
        condition=summary.condition.number,
    )


def start_table(summary: ConditionSummary) -> ReportTable:
    """Return success by starting position under one condition."""
    never, measures = summary.never_succeeding, _measures_of(summary)
    return ReportTable(
        name=f"starts-{summary.condition.number}",
        title=f"{summary.condition.name}: success by starting position",
        columns=(Column("start"), *measures.columns),
        rows=tuple(
            measures.row(group, TableCell(str(group.start), group.start)) for group in summary.starts if group.start
        ),
        notes=(f"Positions without a success: {listed(never)}.",) if summary.total.episodes else (),
        condition=summary.condition.number,
    )


def _measures_of(summary: ConditionSummary) -> Measures:
    return _OF_STACKS if summary.condition.execution == STACK else _OF_MODELS


def _caveats(total: Group) -> list[str]:
    found = SUMMARY.fields(total)
    episodes, trials = counted(total.episodes, "episode"), counted(total.planned, "planned trial")
    notes = [f"n = {episodes} of {trials} ({100 * total.coverage:.1f} %)."]
    if total.repeats:
        notes.append(f"{total.repeats}; the intervals account for repetitions of a cell.")
    if not total.episodes:
        notes.append("No trial of this condition is complete.")
    elif total.episodes < total.planned:
        notes.append("Incomplete: the rates cover the completed trials only.")
    if found["unjudged"]:
        waiting = counted(found["unjudged"], "episode awaits", "episodes await")
        notes.append(f"{waiting} a verdict and no rate includes them.")
    if total.successes and not found["spl_episodes"]:
        notes.append(f"SPL is unknown: no successful episode has a recorded path length (n = {total.successes}).")
    if 0 < found["spl_episodes"] < total.episodes:
        unknown = counted(total.episodes - found["spl_episodes"], "success is", "successes are")
        known = counted(found["spl_episodes"], "episode")
        notes.append(f"SPL is over {known}; the path length of {unknown} unknown.")
    if 0 < found["soft_spl_episodes"] < total.episodes:
        known = counted(found["soft_spl_episodes"], "episode")
        notes.append(f"SoftSPL is over {known} with known path length.")
    if found["spl_episodes"] and total.successes and not found["sct_episodes"]:
        notes.append(f"SCT is unknown: no successful episode has a recorded time (n = {total.successes}).")
    if 0 < found["sct_episodes"] < total.episodes:
        notes.append(f"SCT is over {counted(found['sct_episodes'], 'episode')} with known time.")
    if found["trivial"]:
        began = counted(found["trivial"], "episode is trivial: it began", "episodes are trivial: they began")
        notes.append(f"{began} within {TRIVIAL_M:g} m (one move) of success.")
    return notes
