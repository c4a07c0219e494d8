"""Success by goal with intervals, optionally with the paper's values."""

import itertools
from collections.abc import Iterator, Sequence

from vsnbench.palette import COLORS
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.analysis.published import PAPER_INTERVALS
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.figures.style import (
    FAINT,
    MARKERS,
    MAX_CONDITIONS,
    Drawing,
    column_in,
    in_pages,
    light_grid,
    new_figure,
    page_in,
    styled,
)
from vsnbench.report.figures.text_layout import legend_below, shown
from vsnbench.report.tables.headline import headlines


def success_by_goal(results: ReportResults, published: ReportResults | None = None) -> Iterator[Drawing]:
    """Draw each goal's success rate with its 95 % interval, one row per goal and one mark per condition.

    Args:
        results: recorded results; one figure per `MAX_CONDITIONS` conditions.
        published: the paper's results, drawn grey and hollow in every figure.
    """
    paper = published.conditions if published else ()
    return in_pages(results.conditions, MAX_CONDITIONS - len(paper), lambda ours: _drawing(ours, paper))


def _drawing(ours: Sequence[ConditionSummary], paper: Sequence[ConditionSummary]) -> Drawing:
    series = [*ours, *paper]
    goals = sorted({goal for summary in series for goal in summary.own_goals}, key=goal_order)
    whole = headlines(series)
    rows = goals if len(goals) == 1 else [*goals, whole.label]  # the total of one goal is its rate
    drawn = [
        {str(group.goal): group for group in summary.goals} | {whole.label: headline}
        for summary, (_, headline) in zip(series, whole.by_condition, strict=True)
    ]
    drawn = [
        {goal: goal_summary for goal, goal_summary in summaries.items() if goal_summary.episodes} for summaries in drawn
    ]
    # The height of a row depends on its number of marks.
    heights = [max(1, sum(row in summaries for summaries in drawn)) + 0.9 for row in rows]
    tops = [sum(heights[:index]) for index in range(len(rows) + 1)]
    with styled():
        width = column_in() if len(series) <= 3 else page_in() * 0.75
        figure = new_figure(width, 0.55 + 0.115 * tops[-1])
        axes = figure.subplots()
        taken = [0.95] * len(rows)
        marks, labels = [], []
        for index, (condition_summary, summaries) in enumerate(zip(series, drawn, strict=True)):
            hollow = condition_summary.condition.published
            color = FAINT if hollow else COLORS[index]
            # The paper's models use the last markers, which recorded conditions do not use.
            marker = MARKERS[-1 - (index - len(ours))] if hollow else MARKERS[index]
            places, values, below, above = [], [], [], []
            for row, name in enumerate(rows):
                if summary := summaries.get(name):
                    places.append(tops[row] + taken[row])
                    taken[row] += 1
                    values.append(100 * summary.success_rate)
                    below.append(100 * (summary.success_rate - summary.interval.low))
                    above.append(100 * (summary.interval.high - summary.success_rate))
            mark = axes.errorbar(
                values,
                places,
                xerr=[below, above],
                fmt=marker,
                color=color,
                markerfacecolor="white" if hollow or condition_summary.condition.not_competing else color,
                markersize=4,
                linewidth=0.9,
                capsize=1.8,
                capthick=0.7,
            )
            marks.append(mark)
            bound = ", upper bound" if condition_summary.condition.surveyed else ""
            _, total = whole.by_condition[index]
            labels.append(f"{condition_summary.condition.name}{bound} ({total.successes}/{total.episodes})")
        middles = [(top + bottom) / 2 for top, bottom in itertools.pairwise(tops)]
        axes.set_yticks(middles, [shown(row, 24) for row in rows])
        axes.tick_params(axis="y", length=0)
        axes.set_ylim(tops[-1], 0)
        for edge in tops[1:-1]:
            axes.axhline(edge, color=FAINT if edge == tops[-2] else "#cfcfcf", linewidth=0.5)
        axes.set_xlim(-2, 102)
        axes.set_xlabel("success rate (%), 95 % interval")
        light_grid(axes, "x")
        legend_below(figure, marks, labels)
    people = "a person, " if any(summary.condition.driver for summary in series) else ""
    caption = (
        "Success rate by goal with 95 % intervals (Wilson's at the effective sample size, clustered by starting "
        f"position); in brackets the successes of the counted episodes, over {whole.description}. "
        f"Hollow marks are not competitors: an upper bound with access to the site file, {people}or the paper's value."
    )
    if any(summary.condition.published for summary in series):
        caption += f" {PAPER_INTERVALS}"
    return Drawing(
        "success-by-goal",
        "Success by goal",
        _alt(ours),
        caption,
        footnotes([summary.condition for summary in series]),
        figure,
    )


def _alt(conditions: Sequence[ConditionSummary]) -> str:
    rates = [
        f"{shown(summary.condition.name)} {summary.total.successes} of {summary.total.episodes}"
        for summary in conditions
        if summary.total.episodes
    ]
    return f"Success rate by goal with 95 % intervals. In total: {'; '.join(rates) or 'no completed trial'}."
