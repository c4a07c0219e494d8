"""Floor plans: where the robot went by goal and outcome, and from which starting positions it succeeds."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.site import Site
from vsnbench.report.figures.style import (
    COLLISION,
    COLUMN_IN,
    FAILURE,
    INK,
    LIMIT,
    PAGE_IN,
    SUCCESS,
    Drawing,
    new_figure,
    shown,
    styled,
)
from vsnbench.report.floor_plan import PlanStyle, draw_floor_plan
from vsnbench.report.record import goal_order
from vsnbench.report.summary import ConditionSummary
from vsnbench.report.trajectories import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOOKS = {
    "success": (SUCCESS, (0, ()), "o"),
    "STOP, too far": (FAILURE, (0, (4, 1.2)), "s"),
    "collision": (COLLISION, (0, (1, 1)), "X"),
    "step limit": (LIMIT, (0, (4, 1, 1, 1)), "^"),
}
"""Outcome -> colour, dashes and the mark where the episode ended."""


def trajectory_plan(site: Site, one: ConditionSummary, tracks: Sequence[Track]) -> Drawing | None:
    """Draw one plan a goal with its tracks, coloured, dashed and marked by outcome; None for no tracks."""
    goals = sorted({track.goal for track in tracks}, key=goal_order)
    if not goals:
        return None
    columns = min(3, len(goals))
    lines = -(-len(goals) // columns)
    width = COLUMN_IN if columns == 1 else PAGE_IN
    with styled():
        figure = new_figure(width, lines * width / columns * _shape(site) + 0.25 * lines + 0.25)
        grid = figure.subplots(lines, columns, squeeze=False)
        for axes in grid.flat[len(goals) :]:
            axes.set_axis_off()
        for axes, goal in zip(grid.flat, goals, strict=False):
            _bare_plan(site, axes, goal)
            mine = [track for track in tracks if track.goal == goal]
            _draw_tracks(axes, mine)
            whole = next((each.summary for each in one.goals if each.goal == goal), None)
            sample = f", {len(mine)} drawn" if whole and len(mine) < whole.episodes else ""
            rate = f"{whole.successes}/{whole.episodes}" if whole else ""
            axes.set_title(f"{shown(goal, 20)} {rate}{sample}", pad=2)
        _legend(figure)
        figure.suptitle(f"{shown(one.condition.name, 60)}", fontsize=7.5, color=INK)
    return Drawing(
        f"trajectories-{one.condition.number}",
        f"Trajectories of {shown(one.condition.name, 80)}",
        f"Floor plans with the trajectories of {shown(one.condition.name, 80)}, one plan a goal, by outcome.",
        figure,
    )


def success_map(site: Site, one: ConditionSummary) -> Drawing | None:
    """Draw the share of successes from each starting position as a filled disk; None when no trial is done."""
    from matplotlib.patches import Circle, Wedge
    from matplotlib.patheffects import withStroke

    rates = {each.start: each.summary for each in one.starts if each.summary.episodes}
    places = {start.number: start.position for start in site.starts if start.number in rates}
    if not places:
        return None
    with styled():
        figure = new_figure(COLUMN_IN, COLUMN_IN * _shape(site) + 0.35)
        axes = figure.subplots()
        _bare_plan(site, axes, None)
        for number, (x, y) in places.items():
            summary = rates[number]
            axes.add_patch(Circle((x, y), 0.27, facecolor="white", edgecolor=INK, linewidth=0.7, zorder=12))
            if summary.successes:
                axes.add_patch(
                    Wedge((x, y), 0.27, 90 - 360 * summary.success_rate, 90, facecolor=SUCCESS, alpha=0.55, zorder=12.1)
                )
            axes.text(x, y, str(number), ha="center", va="center_baseline", fontsize=6, weight="bold", zorder=13)
            axes.text(
                *(x, y - 0.31, f"{summary.successes}/{summary.episodes}"),
                ha="center",
                va="top",
                fontsize=5.5,
                zorder=13,
                path_effects=[withStroke(linewidth=1.6, foreground="white")],  # to be read over a wall too
            )
        axes.set_title(f"{shown(one.condition.name, 48)}\nsuccess by starting position", pad=3)
        never = ", ".join(map(str, one.never_succeeding))
        figure.supxlabel(f"never a success: {never or 'none of them'}; filled part = success rate", fontsize=6)
    return Drawing(
        f"success-map-{one.condition.number}",
        f"Success by starting position of {shown(one.condition.name, 80)}",
        f"Floor plan with the success rate at each starting position. Never a success from: {never or 'none'}.",
        figure,
    )


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


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=color, linestyle=dashes, marker=marker, markersize=3, linewidth=0.9, label=name)
        for name, (color, dashes, marker) in _LOOKS.items()
    ]
    handles.append(Line2D([], [], color=INK, marker="o", markersize=2, linestyle="none", label="start"))
    figure.legend(handles=handles, loc="outside lower center", ncols=5, handlelength=3, columnspacing=1.2)


def _bare_plan(site: Site, axes: "Axes", goal: str | None) -> None:
    style = PlanStyle(
        starts=False, labels=False, room_names=False, scale_bar=False, legend=False, highlight=goal or "nothing"
    )
    draw_floor_plan(site, axes, style)


def _shape(site: Site) -> float:
    """Height over width of the plan."""
    import shapely

    x_min, y_min, x_max, y_max = shapely.union_all([wall.shape for wall in site.walls]).bounds
    return float((y_max - y_min + 0.3) / (x_max - x_min + 0.3))
