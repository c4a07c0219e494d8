"""Floor plans: where the robot went by goal and outcome, and from which starting positions it succeeds."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from vsnbench.protocol.judge import EndReason, success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.protocol.walls import bounds_of, wall_area
from vsnbench.report.conditions import Condition, footnotes
from vsnbench.report.figures.lettering import legend_below, shown, wrapped
from vsnbench.report.figures.lettering import width_in as letters_in
from vsnbench.report.figures.style import (
    COLLISION,
    COLUMN_IN,
    FAILURE,
    INK,
    LIMIT,
    PAGE_IN,
    SUCCESS,
    Drawing,
    in_pages,
    new_figure,
    page_name,
    styled,
)
from vsnbench.report.plan.floor_plan import PlanStyle, draw_floor_plan, success_outline
from vsnbench.report.record import goal_order
from vsnbench.report.summary import ConditionSummary
from vsnbench.report.trajectories import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_LOOKS = {
    "success": (SUCCESS, (0, ()), "o"),
    "STOP, too far": (FAILURE, (0, (4, 1.2)), "s"),
    "collision": (COLLISION, (0, (1, 1)), "X"),
    "step limit": (LIMIT, (0, (4, 1, 1, 1)), "^"),
}
"""Outcome -> colour, dashes and the mark where the episode ended."""


MOST_MAPS = 6
"""Maps of successes to a figure."""
_TITLE_PT = 7.0
_SHARE_PT = 5.5
_DISK_M = 0.27
"""Radius of a starting position's disk."""


def trajectory_plan(site: Site, one: ConditionSummary, tracks: Sequence[Track], left_out: str = "") -> Drawing | None:
    """Draw one plan a goal with its tracks, coloured, dashed and marked by outcome; None for no tracks.

    Args:
        site: as it was recorded.
        one: the condition and its rates.
        tracks: of the condition.
        left_out: what the caption is to say of other conditions.
    """
    goals = sorted({track.goal for track in tracks}, key=goal_order)
    if not goals:
        return None
    columns = min(3, len(goals))
    lines = -(-len(goals) // columns)
    width = COLUMN_IN if columns == 1 else PAGE_IN
    with styled():
        title = wrapped(one.condition.name, width - 0.4, 7.5)
        height = lines * width / columns * _shape(site) + 0.25 * lines + 0.13 * len(title.split("\n"))
        figure = new_figure(width, height)
        grid = figure.subplots(lines, columns, squeeze=False)
        for axes in grid.flat[len(goals) :]:
            axes.set_axis_off()
        for axes, goal in zip(grid.flat, goals, strict=False):
            _bare_plan(site, axes, goal, one.condition)
            mine = [track for track in tracks if track.goal == goal]
            _draw_tracks(axes, mine)
            whole = next((each.summary for each in one.goals if each.goal == goal), None)
            sample = f", {len(mine)} drawn" if whole and len(mine) < whole.episodes else ""
            rate = f"{whole.successes}/{whole.episodes}" if whole else ""
            axes.set_title(wrapped(f"{goal} {rate}{sample}", width / columns - 0.15, _TITLE_PT), pad=2)
        legend_below(figure, *_looks())
        figure.suptitle(title, fontsize=7.5, color=INK)
    name = shown(one.condition.name)
    return Drawing(
        f"trajectories-{one.condition.number}",
        f"Trajectories of {name}",
        f"Floor plans with the trajectories of {name}, one plan a goal, by outcome.",
        "Where the robot went, one plan a goal, its instances in colour; the numbers are successes of episodes. "
        "Within the green outline STOP succeeds."
        f"{left_out}",
        footnotes([one.condition]),
        figure,
    )


def success_maps(plans: Sequence[tuple[Site, ConditionSummary]]) -> Iterator[Drawing]:
    """Draw, a plan a condition, the share of successes from each starting position as a filled disk."""
    known = [(site, one) for site, one in plans if _places(site, one)]
    pages = in_pages(known, MOST_MAPS)
    for number, page in enumerate(pages, start=1):
        yield _maps(page, number, len(pages))


def _places(site: Site, one: ConditionSummary) -> dict[int, tuple[float, float]]:
    """Return the starting positions from which trials are done, and where they lie."""
    done = {each.start for each in one.starts if each.summary.episodes}
    return {start.number: start.position for start in site.starts if start.number in done}


def _maps(plans: Sequence[tuple[Site, ConditionSummary]], number: int, pages: int) -> Drawing:
    columns = min(2, len(plans))
    room_in = (COLUMN_IN if columns == 1 else PAGE_IN) / columns - 0.25
    never = [", ".join(map(str, one.never_succeeding)) or "none" for _, one in plans]
    with styled():
        titles = [wrapped(one.condition.name, room_in, 7.5) for _, one in plans]
        below = [wrapped(f"never a success from: {words}", room_in, 6.0) for words in never]
        letters = max(title.count("\n") + words.count("\n") for title, words in zip(titles, below, strict=True))
        tallest = max(_shape(site) for site, _ in plans)
        lines = -(-len(plans) // columns)
        height = lines * ((room_in + 0.25) * tallest + 0.35 + 0.12 * letters)
        figure = new_figure(COLUMN_IN if columns == 1 else PAGE_IN, height)
        grid = figure.subplots(lines, columns, squeeze=False)
        for axes in grid.flat[len(plans) :]:
            axes.set_axis_off()
        for axes, (site, one), title, words in zip(grid.flat, plans, titles, below, strict=False):
            _bare_plan(site, axes, None, one.condition)
            _draw_shares(axes, site, one, room_in + 0.25)
            axes.set_title(title, pad=3)
            axes.text(0.5, -0.01, words, transform=axes.transAxes, ha="center", va="top", fontsize=6)
    conditions = [one.condition for _, one in plans]
    said = "; ".join(f"{shown(one.name)}: {words}" for one, words in zip(conditions, never, strict=True))
    return Drawing(
        page_name("success-map", number),
        f"Success by starting position{f' ({number} of {pages})' if pages > 1 else ''}",
        f"Floor plans with the success rate at each starting position. Never a success from: {said}.",
        "The filled part of a disk is the success rate from that starting position.",
        footnotes(conditions),
        figure,
    )


def _draw_shares(axes: "Axes", site: Site, one: ConditionSummary, width_in: float) -> None:
    from matplotlib.patches import Circle, Wedge
    from matplotlib.patheffects import withStroke

    rates = {each.start: each.summary for each in one.starts}
    places = _places(site, one)
    words = {number: f"{rates[number].successes}/{rates[number].episodes}" for number in places}
    beside = _beside_disks(site, places, words, width_in)
    for number, (x, y) in places.items():
        summary = rates[number]
        axes.add_artist(Circle((x, y), _DISK_M, facecolor="white", edgecolor=INK, linewidth=0.7, zorder=12))
        if summary.successes:
            share = 360 * summary.success_rate
            axes.add_artist(Wedge((x, y), _DISK_M, 90 - share, 90, facecolor=SUCCESS, alpha=0.55, zorder=12.1))
        axes.text(x, y, str(number), ha="center", va="center_baseline", fontsize=6, weight="bold", zorder=13)
        axes.text(
            *(*beside[number], words[number]),
            ha="center",
            va="center",
            fontsize=_SHARE_PT,
            zorder=13,
            path_effects=[withStroke(linewidth=1.6, foreground="white")],  # to be read over a wall too
        )


def _beside_disks(
    site: Site, places: Mapping[int, tuple[float, float]], words: Mapping[int, str], plan_in: float
) -> dict[int, tuple[float, float]]:
    """Return the middle of each position's words, metres: below its disk, or wherever beside it no wall or disk is."""
    import shapely

    walls = wall_area(site)
    x_min, _, x_max, _ = walls.bounds
    inch_m = (x_max - x_min + 0.3) / plan_in
    disks = {number: shapely.Point(place).buffer(_DISK_M) for number, place in places.items()}
    middles = {}
    for number, (x, y) in places.items():
        wide, high = letters_in(words[number], _SHARE_PT) * inch_m, _SHARE_PT / 72 * inch_m
        off_x, off_y = _DISK_M + 0.06 + wide / 2, _DISK_M + 0.04 + high / 2
        around = [(x, y - off_y), (x, y + off_y), (x + off_x, y), (x - off_x, y)]
        taken = shapely.union_all([walls, *(disk for other, disk in disks.items() if other != number)])
        middles[number] = next(
            (
                (mid_x, mid_y)
                for mid_x, mid_y in around
                if not taken.intersects(
                    shapely.box(mid_x - wide / 2, mid_y - high / 2, mid_x + wide / 2, mid_y + high / 2)
                )
            ),
            around[0],
        )
    return middles


def outcome(track: Track) -> str:
    """Return the outcome by which a track is drawn."""
    if track.success:
        return "success"
    if track.end_reason == EndReason.COLLISION.value:
        return "collision"
    return "step limit" if track.end_reason == EndReason.STEP_LIMIT.value else "STOP, too far"


def _draw_tracks(axes: "Axes", tracks: Sequence[Track]) -> None:
    """Draw the tracks of one outcome together: three artists for each would take most of the report's time."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    starts = [track.points[0] for track in tracks]
    for name, (color, dashes, marker) in _LOOKS.items():
        mine = [track.points for track in tracks if outcome(track) == name]
        if not mine:
            continue
        look: dict[str, Any] = {"linestyles": [dashes], "linewidths": 0.7, "alpha": 0.75, "joinstyle": "round"}
        axes.add_collection(LineCollection(mine, colors=color, zorder=10, **look), autolim=False)
        ends = zip(*(points[-1] for points in mine), strict=True)
        axes.add_artist(
            Line2D(*ends, linestyle="", marker=marker, markersize=2.8, color=color, markeredgewidth=0, zorder=11)
        )
    axes.add_artist(Line2D(*zip(*starts, strict=True), linestyle="", marker="o", markersize=1.6, color=INK, zorder=11))


def _looks() -> "tuple[list[Line2D], list[str]]":
    """Return a sample of each outcome's line, and its words."""
    from matplotlib.lines import Line2D

    samples = [
        Line2D([], [], color=color, linestyle=dashes, marker=marker, markersize=3, linewidth=0.9)
        for color, dashes, marker in _LOOKS.values()
    ]
    start = Line2D([], [], color=INK, marker="o", markersize=2, linestyle="none")
    return [*samples, start, success_outline([], [])], [*_LOOKS, "start", "STOP succeeds within"]


def _bare_plan(site: Site, axes: "Axes", goal: str | None, condition: Condition) -> None:
    """Draw the plan, and of a goal from where STOP succeeded under the protocol that was in force."""
    rules = ProtocolParameters.from_record(condition.protocol) if goal and condition.protocol else None
    style = PlanStyle(
        starts=False,
        labels=False,
        room_names=False,
        scale_bar=False,
        legend=False,
        highlight=goal or "nothing",
        success=success_region(site, goal, rules) if goal and rules and site.instances(goal) else None,
    )
    draw_floor_plan(site, axes, style)


def _shape(site: Site) -> float:
    """Height over width of the plan."""
    x_min, y_min, x_max, y_max = bounds_of(site)
    return float((y_max - y_min + 0.3) / (x_max - x_min + 0.3))
