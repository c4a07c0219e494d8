"""Success by goal with intervals, the paper's values beside."""

from vsnbench.report.figures.style import (
    COLORS,
    COLUMN_IN,
    FAINT,
    MARKERS,
    MOST_CONDITIONS,
    PAGE_IN,
    Drawing,
    light_grid,
    new_figure,
    shown,
    styled,
)
from vsnbench.report.record import goal_order
from vsnbench.report.summary import ConditionSummary, Results, Summary


def success_by_goal(results: Results, published: Results | None = None) -> Drawing:
    """Draw each goal's success rate with its 95 % interval, one row a goal and one mark a condition.

    Args:
        results: ours; the first `MOST_CONDITIONS` of them are drawn.
        published: the paper's, drawn hollow.
    """
    series = [*results.conditions[: MOST_CONDITIONS - (2 if published else 0)]]
    measured = len(series)
    series += published.conditions if published else ()
    goals = sorted({goal.goal for one in series for goal in one.goals}, key=goal_order)
    rows = [*goals, "all"]
    step = 1 / (len(series) + 1)
    with styled():
        width = COLUMN_IN if len(series) <= 3 else PAGE_IN * 0.75
        figure = new_figure(width, 0.75 + len(rows) * max(0.26, 0.11 * len(series)) + 0.14 * len(series))
        axes = figure.subplots()
        for index, one in enumerate(series):
            hollow = index >= measured
            color = FAINT if hollow else COLORS[index]
            summaries = {goal.goal: goal.summary for goal in one.goals} | {"all": one.total}
            # The paper's two take the last marks, so that they never look like one of ours.
            marker = MARKERS[-1 - (index - measured)] if hollow else MARKERS[index]
            places, values, below, above = _points(rows, summaries, (index + 1) * step - 0.5)
            axes.errorbar(
                values,
                places,
                xerr=[below, above],
                fmt=marker,
                color=color,
                markerfacecolor="white" if hollow else color,
                markersize=4,
                linewidth=0.9,
                capsize=1.8,
                capthick=0.7,
                label=f"{shown(one.condition.title)} ({one.total.successes}/{one.total.episodes})",
            )
        axes.set_yticks(range(len(rows)), [shown(row, 24) for row in rows])
        axes.set_ylim(len(rows) - 0.5, -0.5)
        for edge in range(len(rows) - 1):
            axes.axhline(edge + 0.5, color="#cfcfcf" if edge < len(goals) - 1 else FAINT, linewidth=0.5)
        axes.set_xlim(-2, 102)
        axes.set_xlabel("success rate (%), Wilson 95 % interval")
        light_grid(axes, "x")
        figure.legend(loc="outside lower center", ncols=1 if width == COLUMN_IN else 2, handletextpad=0.3)
    return Drawing("success-by-goal", "Success by goal", _alt(results.conditions), figure)


def _points(
    rows: list[str], summaries: dict[str, Summary], offset: float
) -> tuple[list[float], list[float], list[float], list[float]]:
    places, values, below, above = [], [], [], []
    for place, goal in enumerate(rows):
        summary = summaries.get(goal)
        if summary is None or not summary.episodes:
            continue
        rate, interval = summary.success_rate, summary.interval
        places.append(place + offset)
        values.append(100 * rate)
        below.append(100 * (rate - interval.low))
        above.append(100 * (interval.high - rate))
    return places, values, below, above


def _alt(conditions: tuple[ConditionSummary, ...]) -> str:
    rates = [
        f"{shown(one.condition.title, 80)} {one.total.successes} of {one.total.episodes}"
        for one in conditions
        if one.total.episodes
    ]
    return f"Success rate by goal with 95 % intervals. In total: {'; '.join(rates) or 'no trial is done'}."
