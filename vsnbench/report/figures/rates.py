"""Success by goal with intervals, the paper's values beside."""

import itertools
from collections.abc import Iterator, Sequence

from vsnbench.report.conditions import footnotes
from vsnbench.report.figures.lettering import legend_below, shown
from vsnbench.report.figures.style import (
    COLORS,
    COLUMN_IN,
    FAINT,
    MARKERS,
    MOST_CONDITIONS,
    PAGE_IN,
    Drawing,
    in_pages,
    light_grid,
    new_figure,
    page_name,
    styled,
)
from vsnbench.report.record import goal_order
from vsnbench.report.summary import ConditionSummary, Results


def success_by_goal(results: Results, published: Results | None = None) -> Iterator[Drawing]:
    """Draw each goal's success rate with its 95 % interval, one row a goal and one mark a condition.

    Args:
        results: ours; so many to a figure as colours tell apart.
        published: the paper's, drawn grey and hollow in every figure.
    """
    paper = published.conditions if published else ()
    pages = in_pages(results.conditions, MOST_CONDITIONS - len(paper))
    for number, ours in enumerate(pages, start=1):
        yield _drawing(ours, paper, number, len(pages))


def _drawing(ours: Sequence[ConditionSummary], paper: Sequence[ConditionSummary], number: int, pages: int) -> Drawing:
    series = [*ours, *paper]
    goals = sorted({goal.goal for one in series for goal in one.goals}, key=goal_order)
    rows = [*goals, "all"]
    drawn = [{goal.goal: goal.summary for goal in one.goals} | {"all": one.total} for one in series]
    drawn = [{goal: each for goal, each in summaries.items() if each.episodes} for summaries in drawn]
    # A row is as high as it has marks: a goal that only the paper has takes little room.
    heights = [max(1, sum(row in summaries for summaries in drawn)) + 0.9 for row in rows]
    tops = [sum(heights[:index]) for index in range(len(rows) + 1)]
    with styled():
        width = COLUMN_IN if len(series) <= 3 else PAGE_IN * 0.75
        figure = new_figure(width, 0.55 + 0.115 * tops[-1])
        axes = figure.subplots()
        taken = [0.95] * len(rows)
        marks, labels = [], []
        for index, (one, summaries) in enumerate(zip(series, drawn, strict=True)):
            hollow = one.condition.published
            color = FAINT if hollow else COLORS[index]
            # The paper's two take the last marks, so that they never look like one of ours.
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
                markerfacecolor="white" if hollow or one.condition.surveyed else color,
                markersize=4,
                linewidth=0.9,
                capsize=1.8,
                capthick=0.7,
            )
            marks.append(mark)
            bound = ", upper bound" if one.condition.surveyed else ""
            labels.append(f"{one.condition.name}{bound} ({one.total.successes}/{one.total.episodes})")
        middles = [(top + bottom) / 2 for top, bottom in itertools.pairwise(tops)]
        axes.set_yticks(middles, [shown(row, 24) for row in rows])
        axes.tick_params(axis="y", length=0)
        axes.set_ylim(tops[-1], 0)
        for edge in tops[1:-1]:
            axes.axhline(edge, color=FAINT if edge == tops[-2] else "#cfcfcf", linewidth=0.5)
        axes.set_xlim(-2, 102)
        axes.set_xlabel("success rate (%), Wilson 95 % interval")
        light_grid(axes, "x")
        legend_below(figure, marks, labels)
    caption = (
        "Success rate by goal with 95 % intervals; in brackets the successes of the episodes that count, all goals. "
        "A hollow mark is no competitor: an upper bound that is handed the site, or the paper's published value."
    )
    return Drawing(
        page_name("success-by-goal", number),
        f"Success by goal{f' ({number} of {pages})' if pages > 1 else ''}",
        _alt(ours),
        caption,
        footnotes([one.condition for one in series]),
        figure,
    )


def _alt(conditions: Sequence[ConditionSummary]) -> str:
    rates = [
        f"{shown(one.condition.name)} {one.total.successes} of {one.total.episodes}"
        for one in conditions
        if one.total.episodes
    ]
    return f"Success rate by goal with 95 % intervals. In total: {'; '.join(rates) or 'no trial is done'}."
