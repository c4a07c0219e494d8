"""Floor plans with the places of failures, by kind; the numbers are those of the tables."""

from collections.abc import Iterable, Iterator, Sequence

from vsnbench.palette import COLLISION, COLORS, FAILURE, LIMIT
from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.analysis.failures import FailureKind, FailurePlace
from vsnbench.report.analysis.summary import ConditionSummary
from vsnbench.report.figures.plans import bare_plan, plan_shape
from vsnbench.report.figures.style import INK, Drawing, column_in, in_pages, new_figure, page_in, panel_axes, styled
from vsnbench.report.figures.text_layout import legend_below, shown, wrapped
from vsnbench.report.tables.progress import MAX_PLACES
from vsnbench.sites.site import Site

MAX_MAPS = 4
"""Maps per figure."""
_LOOKS = {
    FailureKind.STUCK: (LIMIT, "^"),
    FailureKind.CIRCLING: (COLORS[2], "o"),
    FailureKind.STOPPED_EARLY: (FAILURE, "s"),
    FailureKind.STOPPED_FAR: (COLORS[5], "s"),
    FailureKind.PASSED: (COLORS[4], "D"),
    FailureKind.REACHED: (COLORS[0], "D"),
    FailureKind.COLLISION: (COLLISION, "X"),
}
"""Kind -> colour and marker; other kinds have no place."""

_LABEL_PT = 9
"""Places closer than this share a label."""

_Map = tuple[Site, ConditionSummary, Sequence[FailurePlace]]


def failure_maps(maps: Iterable[_Map]) -> Iterator[Drawing]:
    """Draw one plan per condition that has places of failures."""
    return in_pages([found for found in maps if found[2]], MAX_MAPS, _drawing)


def _labels(places: Sequence[FailurePlace], near_m: float) -> list[tuple[float, float, str]]:
    """Return position and text of each label; neighbouring places share one."""
    labels = list[tuple[float, float, str]]()
    for rank, place in enumerate(places, start=1):
        for index, (x_m, y_m, ranks) in enumerate(labels):
            if max(abs(place.x_m - x_m), abs(place.y_m - y_m)) < near_m:
                labels[index] = (x_m, y_m, f"{ranks}, {rank}")
                break
        else:
            labels.append((place.x_m, place.y_m, f"{rank}"))
    return labels


def _drawing(maps: Sequence[_Map]) -> Drawing:
    from matplotlib.lines import Line2D

    columns = min(2, len(maps))
    width = column_in() if columns == 1 else page_in()
    lines = -(-len(maps) // columns)
    with styled():
        titles = [wrapped(summary.condition.name, width / columns - 0.25, 7.5) for _, summary, _ in maps]
        tallest = max(plan_shape(site) for site, _, _ in maps)
        height = lines * (width / columns * tallest + 0.3 + 0.12 * max(title.count("\n") for title in titles)) + 0.2
        figure = new_figure(width, height)
        grid = panel_axes(figure, len(maps), columns)
        for axes, (site, summary, places), title in zip(grid, maps, titles, strict=True):
            bare_plan(site, axes, None, summary.condition)
            for place in places[:MAX_PLACES]:
                color, marker = _LOOKS[place.kind]
                size = 5 + 1.5 * min(len(place.episodes), 8) ** 0.5
                axes.plot(
                    place.x_m, place.y_m, marker, color=color, markersize=size, markeredgecolor="white", zorder=12
                )
            left_m, right_m = axes.get_xlim()
            for x_m, y_m, ranks in _labels(
                places[:MAX_PLACES], _LABEL_PT * (right_m - left_m) / (width / columns * 72)
            ):
                axes.annotate(ranks, (x_m, y_m), (4, 3), textcoords="offset points", fontsize=5.5, zorder=13)
            axes.set_title(title, pad=3, color=INK)
        drawn = {place.kind for _, _, places in maps for place in places[:MAX_PLACES]}
        looks = {kind: look for kind, look in _LOOKS.items() if kind in drawn}
        samples = [Line2D([], [], color=c, marker=m, linestyle="none", markersize=4) for c, m in looks.values()]
        legend_below(figure, samples, [kind.value for kind in looks])
    words = "; ".join(
        f"{shown(summary.condition.name)}: {sum(len(place.episodes) for place in places)} failures at "
        f"{len(places)} places"
        for _, summary, places in maps
    )
    return Drawing(
        "failure-map",
        "Where models fail",
        f"Floor plans with the places of failures by kind. {words}.",
        "Places of failures: where the episode ended, or where it was nearest to a goal that it passed. The numbers "
        "are those of the tables `where it fails`, which link the episodes; larger markers are more failures.",
        footnotes([summary.condition for _, summary, _ in maps]),
        figure,
    )
