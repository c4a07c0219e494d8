"""Success by starting position and goal, one panel per condition."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from vsnbench.palette import SUCCESS
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.analysis.sensitivity import Grid, grid
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults
from vsnbench.report.figures.style import INK, Drawing, column_in, in_pages, new_figure, page_in, panel_axes, styled
from vsnbench.report.figures.text_layout import legend_below, shown, wrapped

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_PANELS = 6
"""Panels per figure."""
_UNTRIED = "#e9e6e0"
_HALF = "#80b8d9"
"""Colour half way from white to that of success."""
_LINE_IN = 0.125
_TITLE_PT = 7.0

_Panel = tuple[ConditionSummary, Grid]


def success_by_cell(results: ReportResults) -> Iterator[Drawing]:
    """Draw each cell's success rate as a shade; nothing without known starting positions or with a single cell."""
    panels = [(summary, cells) for summary in results.conditions if len((cells := grid(summary)).cells) > 1]
    return in_pages(panels, MAX_PANELS, _drawing)


def _drawing(panels: Sequence[_Panel]) -> Drawing:
    from matplotlib.patches import Patch

    columns = min(3, len(panels))
    lines = -(-len(panels) // columns)
    width = column_in() if columns == 1 else page_in()
    # All panels have the same rows and columns, so that they can be compared.
    goals = sorted({goal for _, cells in panels for goal in cells.goals}, key=goal_order)
    starts = sorted({start for _, cells in panels for start in cells.starts})
    with styled():
        titles = [
            wrapped(
                f"{summary.condition.name}: {summary.total.successes}/{summary.total.episodes}",
                width / columns - 0.5,
                _TITLE_PT,
            )
            for summary, _ in panels
        ]
        letters = max(title.count("\n") + 1 for title in titles)
        figure = new_figure(width, lines * (0.85 + 0.12 * letters + _LINE_IN * len(starts)))
        grid = panel_axes(figure, len(panels), columns)
        for axes, (_, cells), title in zip(grid, panels, titles, strict=True):
            _draw(axes, cells, goals, starts)
            axes.set_title(title, fontsize=_TITLE_PT, color=INK, loc="left")
        for axes in grid[::columns]:
            axes.set_ylabel("starting position")
        samples = [
            Patch(facecolor=color, edgecolor=INK, linewidth=0.4) for color in (SUCCESS, _HALF, "white", _UNTRIED)
        ]
        legend_below(figure, samples, ["all episodes succeeded", "half of them", "none", "not tested"])
    caption = (
        "Success by starting position and goal; darker cells have a higher success rate. A dark row is a starting "
        "position from which all goals are found, a light column a goal that is rarely found."
    )
    words = "; ".join(
        f"{shown(summary.condition.name)}: {sum(cell.successes > 0 for cell in cells.cells.values())} of "
        f"{len(cells.cells)} cells with a success"
        for summary, cells in panels
    )
    return Drawing(
        "success-by-cell",
        "Success by starting position and goal",
        f"Shades of the success rate of every starting position and goal. {words}.",
        caption,
        footnotes([summary.condition for summary, _ in panels]),
        figure,
    )


def _draw(axes: "Axes", cells: Grid, goals: Sequence[str], starts: Sequence[int]) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    rates = np.full((len(starts), len(goals)), np.nan)
    for (goal, start), proportion in cells.cells.items():
        rates[starts.index(start), goals.index(goal)] = proportion.rate
    shades = LinearSegmentedColormap.from_list("successes", ["white", SUCCESS])
    axes.set_facecolor(_UNTRIED)
    axes.pcolormesh(np.ma.masked_invalid(rates), cmap=shades, vmin=0, vmax=1, edgecolors="#b9b9b9", linewidth=0.4)
    axes.invert_yaxis()
    axes.set_xticks(np.arange(len(goals)) + 0.5, [shown(goal, 16) for goal in goals], rotation=90, fontsize=6)
    every = -(-len(starts) // 30)  # limits the number of tick labels
    axes.set_yticks(np.arange(len(starts))[::every] + 0.5, [str(n) for n in starts[::every]], fontsize=6)
    axes.tick_params(length=0)
