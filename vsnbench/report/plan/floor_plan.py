"""Draws the floor plan of a site."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shapely

from vsnbench.report.plan.building import draw_building, name_room
from vsnbench.report.plan.furniture import GOAL_COLORS, draw_furniture
from vsnbench.report.plan.ink import INK, Ink
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.geometry.walls import bounds_of
from vsnbench.sites.site import Site, StartingPosition

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from numpy.typing import ArrayLike
    from shapely.geometry.base import BaseGeometry

_SUCCESS = "#2e7d32"
_START = "#0b3c5d"
_GRID = "#7d8a96"


@dataclass(frozen=True, slots=True)
class PlanStyle:
    """What a plan shows besides walls, doors, windows and furniture."""

    starts: bool = True
    labels: bool = True
    room_names: bool = True
    scale_bar: bool = True
    legend: bool = True
    highlight: str | None = None
    """Goal whose targets are in full colour; the others are faded."""
    grid: bool = False
    """Draw axes in metres with a line every metre."""
    success: "BaseGeometry | None" = None
    """Region in which STOP succeeds (`protocol.judge.success_region`), outlined."""


def draw_floor_plan(site: Site, axes: "Axes | None" = None, style: PlanStyle | None = None) -> "Axes":
    """Draw the plan into `axes` (metres, equal scales) or a new figure, and return the axes.

    Further drawings belong at zorder 10 or above.
    """
    wanted = PlanStyle() if style is None else style
    if axes is None:
        axes = _new_axes(site)
    ink = Ink()
    draw_building(ink, axes, site)
    draw_furniture(ink, axes, site, highlight=wanted.highlight, labels=wanted.labels)
    if wanted.room_names:
        for room in site.rooms:
            name_room(axes, site, room)
    if wanted.starts:
        for start in site.starts:
            _draw_start(axes, start)
    x_min, y_min, x_max, y_max = bounds_of(site)
    below = 0.0
    if wanted.scale_bar:
        _draw_scale_bar(ink, axes, x_min, y_min - 0.35)
        below = 0.75
    if wanted.legend:
        beside_the_bar = x_max - _legend_width_m(site) > x_min + 2.5
        below = 0.75 if beside_the_bar or not wanted.scale_bar else 1.1
        _draw_legend(ink, axes, site, x_max, y_min - 0.28 if below == 0.75 else y_min - 0.7)
    ink.put_on(axes)
    if wanted.success is not None:
        for ring in shapely.get_rings(shapely.get_parts(wanted.success)):
            axes.add_artist(success_outline(*shapely.get_coordinates(ring).T))
    axes.set_xlim(x_min - 0.15, x_max + 0.15)
    axes.set_ylim(y_min - 0.15 - below, y_max + 0.15)
    axes.set_aspect("equal")
    if wanted.grid:
        _draw_grid(axes, (x_min, y_min, x_max, y_max))
    axes.set_axis_off()
    return axes


def _draw_grid(axes: "Axes", bounds: tuple[float, float, float, float]) -> None:
    """Draw a line every metre with its coordinate on the left and upper side."""
    x_min, y_min, x_max, y_max = bounds
    for x_m in range(math.ceil(x_min), math.floor(x_max) + 1):
        axes.plot([x_m, x_m], [y_min, y_max + 0.05], color=_GRID, linewidth=0.4, zorder=1.5)
        axes.text(x_m, y_max + 0.08, f"{x_m}", ha="center", va="bottom", fontsize=6, color=INK)
    for y_m in range(math.ceil(y_min), math.floor(y_max) + 1):
        axes.plot([x_min - 0.05, x_max], [y_m, y_m], color=_GRID, linewidth=0.4, zorder=1.5)
        axes.text(x_min - 0.08, y_m, f"{y_m}", ha="right", va="center", fontsize=6, color=INK)
    axes.text(x_max, y_max + 0.24, "x, m", ha="right", va="bottom", fontsize=6, color=INK)
    axes.text(x_min - 0.08, y_max, "y, m", ha="right", va="top", fontsize=6, color=INK)
    axes.set_xlim(x_min - 0.45, axes.get_xlim()[1])
    axes.set_ylim(axes.get_ylim()[0], y_max + 0.5)


def save_floor_plan(site: Site, path: Path, style: PlanStyle | None = None) -> None:
    """Save the plan; the suffix gives the format (.svg, .png, .pdf).

    Raises:
        OSError: the file cannot be written.
        ValueError: the format is unknown.
    """
    import matplotlib as mpl

    axes = draw_floor_plan(site, style=style)
    figure: Figure = axes.figure  # type: ignore[assignment]  # a new figure, never a sub-figure
    with mpl.rc_context({"svg.hashsalt": site.name, "svg.fonttype": "none", "text.parse_math": False}):
        metadata: dict[str, Any] = {"Date": None} if path.suffix == ".svg" else {}
        figure.savefig(path, dpi=200, bbox_inches="tight", pad_inches=0.03, metadata=metadata)


def _new_axes(site: Site) -> "Axes":
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    x_min, y_min, x_max, y_max = bounds_of(site)
    width_in = 7.2
    figure = Figure(figsize=(width_in, width_in * (y_max - y_min + 1.05) / (x_max - x_min + 0.3)))
    FigureCanvasAgg(figure)
    return figure.add_axes((0, 0, 1, 1))


def success_outline(x_m: "ArrayLike", y_m: "ArrayLike") -> "Line2D":
    """Return the outline of the region in which STOP succeeds, metres; also used as a legend sample."""
    from matplotlib.lines import Line2D

    return Line2D(x_m, y_m, color=_SUCCESS, linewidth=1.0, linestyle=(0, (4, 2)), zorder=4.5)


def _draw_start(axes: "Axes", start: StartingPosition) -> None:
    from matplotlib.patches import Circle, Polygon

    x, y = start.position
    radius, tip = 0.15, 0.32
    heading = start.pose.heading_rad
    around = [(tip, 0.0), (radius * 0.88, 0.62), (radius * 0.88, -0.62)]
    arrow = [(x + far * math.cos(heading + off), y + far * math.sin(heading + off)) for far, off in around]
    axes.add_artist(Polygon(arrow, closed=True, facecolor=_START, edgecolor="none", zorder=8))
    axes.add_artist(Circle((x, y), radius, facecolor="white", edgecolor=_START, linewidth=1.0, zorder=8.1))
    axes.text(
        x, y, str(start.number), ha="center", va="center_baseline", fontsize=6, weight="bold", color=_START, zorder=8.2
    )


def _draw_scale_bar(ink: Ink, axes: "Axes", x_m: float, y_m: float) -> None:
    for metre in range(2):
        left, right = x_m + metre, x_m + metre + 1
        box = [(left, y_m), (right, y_m), (right, y_m - 0.07), (left, y_m - 0.07)]
        ink.fill(box, face=INK if metre % 2 == 0 else "white", edge=INK, width_pt=0.6, layer=6)
    for metre in range(3):
        words = f"{metre} m" if metre == 2 else str(metre)
        axes.text(x_m + metre, y_m - 0.13, words, ha="center", va="top", fontsize=6, color=INK)


def _legend_entries(site: Site) -> list[tuple[str, str, float]]:
    """Return goal category, label and width in metres of every legend entry."""
    words = {goal: f"{goal} ({len(site.instances(goal))})" for goal in GOAL_CATEGORIES if site.instances(goal)}
    return [(goal, text, 0.3 + 0.066 * len(text) + 0.18) for goal, text in words.items()]


def _legend_width_m(site: Site) -> float:
    return sum(width_m for _, _, width_m in _legend_entries(site))


def _draw_legend(ink: Ink, axes: "Axes", site: Site, x_right_m: float, y_m: float) -> None:
    """Draw the legend: the goal categories of the site with their number of instances."""
    left = x_right_m - _legend_width_m(site)
    for goal, words, width in _legend_entries(site):
        box = [(left, y_m - 0.08), (left + 0.2, y_m - 0.08), (left + 0.2, y_m - 0.24), (left, y_m - 0.24)]
        ink.fill(box, face=GOAL_COLORS[goal], edge="#4a4a48", width_pt=0.5, layer=6)
        axes.text(left + 0.27, y_m - 0.16, words, ha="left", va="center", fontsize=6.5, color=INK)
        left += width
