"""Draws a site's floor plan as a person would put it in a paper; trajectories can be drawn over it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.site import Door, Room, Site, SiteObject, StartingPosition, Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GOAL_COLORS: dict[str, str] = {
    "chair": "#f2a65a",
    "sofa": "#8fb8de",
    "table": "#c9a27e",
    "bed": "#b8a1d9",
    "toilet": "#7fcdc3",
    "monitor": "#ef8a8a",
    "plant": "#9ccc78",
}
"""One colour a goal category, the same in every figure of ours."""

_FLOORS = {"wood": "#fbf8f2", "tiles": "#f1f5f7", "carpet": "#f7f3f5", "concrete": "#f4f4f2"}
_FURNITURE_FILL, _FURNITURE_EDGE = "#e9e9e7", "#a3a3a0"
_INK = "#1a1a1a"
_START = "#0b3c5d"
_LABEL_PT = 5.2
_DRAWN_LAST = frozenset({"monitor", "lamp"})
_NOT_DRAWN = frozenset({"picture"})


@dataclass(frozen=True, slots=True)
class PlanStyle:
    """What the plan shows besides walls, doors, windows and furniture."""

    starts: bool = True
    labels: bool = True
    room_names: bool = True
    scale_bar: bool = True
    legend: bool = True
    highlight: str | None = None
    """A goal category to show in full colour while the others step back."""


def draw_floor_plan(site: Site, axes: "Axes | None" = None, style: PlanStyle | None = None) -> "Axes":
    """Draw the plan into `axes` (metres, equal scales) or into a new figure, and return the axes.

    What is drawn over it belongs at zorder 10 or above.
    """
    wanted = PlanStyle() if style is None else style
    if axes is None:
        axes = _new_axes(site)
    for room in site.rooms:
        _fill(axes, room.polygon, facecolor=_FLOORS[room.floor], edgecolor="none", zorder=0)
    for thing in sorted(site.objects, key=_drawing_order):
        if thing.category not in _NOT_DRAWN:
            above = [other for other in site.objects if other.elevation_m > thing.elevation_m]
            _draw_object(axes, thing, above, wanted)
    _draw_walls(axes, site)
    for window in site.windows:
        _draw_window(axes, site, window)
    for door in site.doors:
        _draw_door(axes, site, door)
    if wanted.room_names:
        for room in site.rooms:
            _name_room(axes, site, room)
    if wanted.starts:
        for start in site.starts:
            _draw_start(axes, start)
    x_min, y_min, x_max, y_max = _bounds(site)
    below = 0.0
    if wanted.scale_bar:
        _draw_scale_bar(axes, x_min, y_min - 0.35)
        below = 0.75
    if wanted.legend:
        beside_the_bar = x_max - _legend_width_m(site) > x_min + 2.5
        below = 0.75 if beside_the_bar or not wanted.scale_bar else 1.1
        _draw_legend(axes, site, x_max, y_min - 0.28 if below == 0.75 else y_min - 0.7)
    axes.set_xlim(x_min - 0.15, x_max + 0.15)
    axes.set_ylim(y_min - 0.15 - below, y_max + 0.15)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return axes


def save_floor_plan(site: Site, path: Path, style: PlanStyle | None = None, dpi: int = 200) -> None:
    """Draw the plan into a file; its suffix says the format (.svg, .png, .pdf).

    Raises:
        OSError: the file cannot be written.
        ValueError: the format is not known.
    """
    import matplotlib as mpl

    axes = draw_floor_plan(site, style=style)
    figure: Figure = axes.figure  # type: ignore[assignment]  # a new figure, never a sub-figure
    with mpl.rc_context({"svg.hashsalt": site.name, "svg.fonttype": "none"}):
        metadata: dict[str, Any] = {"Date": None} if path.suffix == ".svg" else {}
        figure.savefig(path, dpi=dpi, bbox_inches="tight", pad_inches=0.03, metadata=metadata)


def _new_axes(site: Site) -> "Axes":
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    x_min, y_min, x_max, y_max = _bounds(site)
    width_in = 7.2
    figure = Figure(figsize=(width_in, width_in * (y_max - y_min + 1.05) / (x_max - x_min + 0.3)))
    FigureCanvasAgg(figure)
    return figure.add_axes((0, 0, 1, 1))


def _bounds(site: Site) -> tuple[float, float, float, float]:
    import shapely

    x_min, y_min, x_max, y_max = shapely.union_all([wall.shape for wall in site.walls]).bounds
    return x_min, y_min, x_max, y_max


def _fill(axes: "Axes", outline: Any, **look: Any) -> None:
    from matplotlib.patches import Polygon

    axes.add_artist(Polygon(list(outline), closed=True, **look))  # `add_patch` would work out limits that we set


def _line(axes: "Axes", points: Iterable[tuple[float, float]], **look: Any) -> None:
    from matplotlib.lines import Line2D

    axes.add_artist(Line2D(*zip(*points, strict=True), **look))


def _drawing_order(thing: SiteObject) -> tuple[bool, float, bool]:
    """Rugs first; then from the floor up, so that a monitor is seen on its desk."""
    return thing.solid, thing.elevation_m + (thing.category in _DRAWN_LAST), thing.category in GOAL_CATEGORIES


def _draw_object(axes: "Axes", thing: SiteObject, above: list[SiteObject], style: PlanStyle) -> None:
    outline = list(thing.shape.exterior.coords)
    if not thing.solid:
        _fill(axes, outline, facecolor="#f0ebe4", edgecolor="#d8cfc3", linewidth=0.5, zorder=1)
        return
    goal = thing.category in GOAL_COLORS
    muted = style.highlight is not None and thing.category != style.highlight
    face = GOAL_COLORS[thing.category] if goal and not muted else _FURNITURE_FILL
    look: dict[str, Any] = {"facecolor": face, "edgecolor": "#4a4a48" if goal and not muted else _FURNITURE_EDGE}
    if thing.elevation_m > 1.2:  # what hangs above the robot is an outline, as architects draw it
        look |= {"facecolor": "none", "linestyle": (0, (4, 2))}
    _fill(axes, outline, linewidth=0.6, zorder=2, **look)
    _draw_front(axes, thing, look["edgecolor"])
    if style.labels and thing.elevation_m <= 1.2:
        _label(axes, thing, above, always=goal and not muted)


def _draw_front(axes: "Axes", thing: SiteObject, color: str) -> None:
    """Hint at which side a seat or a bed faces: its back, or the pillows, as a line."""
    share = {"chair": 0.16, "sofa": 0.24, "bed": 0.22, "toilet": 0.28}.get(thing.category)
    if share is None or thing.footprint is not None:
        return
    depth, width, _ = thing.size_m
    cos, sin = math.cos(thing.pose.heading_rad), math.sin(thing.pose.heading_rad)
    back = -depth / 2 + share * depth
    x, y = thing.position
    ends = [(x + cos * back - sin * side, y + sin * back + cos * side) for side in (-width / 2, width / 2)]
    _line(axes, ends, color=color, linewidth=0.6, zorder=2.1, solid_capstyle="butt")


def _label(axes: "Axes", thing: SiteObject, above: list[SiteObject], always: bool) -> None:
    """Write what it is where nothing stands on it; not at all where that is too small, unless `always`."""
    words = thing.category.replace("_", " ")
    x_min, y_min, x_max, y_max = _free_strip(thing, above)
    wide, high = x_max - x_min, y_max - y_min
    if " " in words and _text_m(words) > max(wide, high):
        words = words.replace(" ", "\n")
    needed = max(_text_m(line) for line in words.split("\n"))
    if not always and (needed > max(wide, high) or min(wide, high) < 0.14):
        return
    axes.text(
        (x_min + x_max) / 2,
        (y_min + y_max) / 2,
        words,
        ha="center",
        va="center",
        rotation=90 if needed > wide and high > wide else 0,
        fontsize=_LABEL_PT,
        color="#3c3c3a",
        linespacing=0.9,
        zorder=3,
    )


def _text_m(words: str) -> float:
    return 0.058 * len(words)


def _free_strip(thing: SiteObject, above: list[SiteObject]) -> tuple[float, float, float, float]:
    """Return the largest strip of its bounds that nothing standing on it, or hanging over it, covers."""
    x_min, y_min, x_max, y_max = strip = thing.shape.bounds
    for other in above:
        if other.category in _NOT_DRAWN or not other.shape.intersects(thing.shape):
            continue
        left, low, right, high = other.shape.bounds
        strips = [(x_min, y_min, left, y_max), (right, y_min, x_max, y_max)]
        strips += [(x_min, y_min, x_max, low), (x_min, high, x_max, y_max)]
        x_min, y_min, x_max, y_max = strip = max(strips, key=lambda each: (each[2] - each[0]) * (each[3] - each[1]))
    return strip


def _draw_walls(axes: "Axes", site: Site) -> None:
    import shapely
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    ends = [(door.start, door.end) for door in site.doors]
    ends += [(window.start, window.end) for window in site.windows]
    openings = [shapely.LineString(each).buffer(0.3, cap_style="flat") for each in ends]
    solid = shapely.union_all([wall.shape for wall in site.walls]).difference(shapely.union_all(openings))
    for part in shapely.get_parts(solid):
        rings = [Outline(list(ring.coords), closed=True) for ring in (part.exterior, *part.interiors)]
        outline = Outline.make_compound_path(*rings)
        axes.add_artist(PathPatch(outline, facecolor=_INK, edgecolor=_INK, linewidth=0.3, zorder=5))


@dataclass(frozen=True, slots=True)
class _Opening:
    """Where a door or a window lies: its two ends, a unit vector along it and one to its left, the wall's half."""

    start: tuple[float, float]
    end: tuple[float, float]
    along: tuple[float, float]
    left: tuple[float, float]
    half_m: float

    def at(self, along_m: float, left_m: float) -> tuple[float, float]:
        return (
            self.start[0] + self.along[0] * along_m + self.left[0] * left_m,
            self.start[1] + self.along[1] * along_m + self.left[1] * left_m,
        )


def _opening(site: Site, start: tuple[float, float], end: tuple[float, float]) -> _Opening:
    from vsnbench.protocol.walls import walls_of

    length = math.dist(start, end)
    along = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
    walls = walls_of(site, start, end)
    return _Opening(start, end, along, (-along[1], along[0]), walls[0].thickness_m / 2 if walls else 0.05)


def _draw_window(axes: "Axes", site: Site, window: Window) -> None:
    opening, length = _opening(site, window.start, window.end), math.dist(window.start, window.end)
    half = opening.half_m
    frame = [opening.at(0, -half), opening.at(length, -half), opening.at(length, half), opening.at(0, half)]
    _fill(axes, frame, facecolor="white", edgecolor=_INK, linewidth=0.7, zorder=5)
    pane = (opening.at(0, 0), opening.at(length, 0))
    _line(axes, pane, color=_INK, linewidth=0.6, zorder=5.1, solid_capstyle="butt")


def _draw_door(axes: "Axes", site: Site, door: Door) -> None:
    opening, length = _opening(site, door.start, door.end), door.clear_width_m
    half = opening.half_m
    if door.closed:
        leaf = [
            opening.at(0, half - 0.05),
            opening.at(length, half - 0.05),
            opening.at(length, half),
            opening.at(0, half),
        ]
        sill = [opening.at(0, -half), opening.at(length, -half), opening.at(length, half), opening.at(0, half)]
        _fill(axes, sill, facecolor="white", edgecolor=_INK, linewidth=0.5, zorder=5)
        _fill(axes, leaf, facecolor="#8a8a88", edgecolor=_INK, linewidth=0.5, zorder=5.1)
        return
    thickness = 0.04
    leaf = [
        opening.at(0, half),
        opening.at(thickness, half),
        opening.at(thickness, half + length),
        opening.at(0, half + length),
    ]
    _fill(axes, leaf, facecolor="white", edgecolor="#7a7a78", linewidth=0.6, zorder=4)
    angles = [math.pi / 2 * step / 24 for step in range(25)]
    swing = [opening.at(length * math.cos(angle), half + length * math.sin(angle)) for angle in angles]
    _line(axes, swing, color="#7a7a78", linewidth=0.5, zorder=4)


def _name_room(axes: "Axes", site: Site, room: Room) -> None:
    """Write the room's name where it has most room among the furniture."""
    import numpy as np
    import shapely

    half_wide, half_high = 0.045 * len(room.name) + 0.1, 0.14
    busy = [thing.shape for thing in site.objects if thing.category not in _NOT_DRAWN]
    busy += [wall.shape for wall in site.walls]
    busy += [shapely.Point(start.position).buffer(0.3) for start in site.starts]
    for door in site.doors:
        busy.append(door.centre_line.buffer(door.clear_width_m + 0.05, cap_style="flat"))
    x_min, y_min, x_max, y_max = room.shape.bounds
    xs, ys = np.meshgrid(np.arange(x_min, x_max, 0.1), np.arange(y_min, y_max, 0.1))
    xs, ys = xs.ravel(), ys.ravel()
    boxes = shapely.box(xs - half_wide, ys - half_high, xs + half_wide, ys + half_high)
    room_to_spare = shapely.distance(boxes, shapely.union_all(busy))
    middle = room.shape.centroid
    liking = np.minimum(room_to_spare, 0.25) - 0.02 * np.hypot(xs - middle.x, ys - middle.y)
    liking[~shapely.within(boxes, room.shape)] = -np.inf
    best = int(np.argmax(liking))
    at = (float(xs[best]), float(ys[best])) if np.isfinite(liking[best]) else (middle.x, middle.y)
    axes.text(*at, room.name, ha="center", va="center", fontsize=7.5, style="italic", color="#55534f", zorder=3.5)


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


def _draw_scale_bar(axes: "Axes", x_m: float, y_m: float) -> None:
    for metre in range(2):
        left, right = x_m + metre, x_m + metre + 1
        box = [(left, y_m), (right, y_m), (right, y_m - 0.07), (left, y_m - 0.07)]
        _fill(axes, box, facecolor=_INK if metre % 2 == 0 else "white", edgecolor=_INK, linewidth=0.6, zorder=6)
    for metre in range(3):
        words = f"{metre} m" if metre == 2 else str(metre)
        axes.text(x_m + metre, y_m - 0.13, words, ha="center", va="top", fontsize=6, color=_INK)


def _legend_entries(site: Site) -> list[tuple[str, str, float]]:
    """Return goal category, words and width in metres of every entry of the legend."""
    words = {goal: f"{goal} ({len(site.instances(goal))})" for goal in GOAL_CATEGORIES if site.instances(goal)}
    return [(goal, text, 0.3 + 0.066 * len(text) + 0.18) for goal, text in words.items()]


def _legend_width_m(site: Site) -> float:
    return sum(width_m for _, _, width_m in _legend_entries(site))


def _draw_legend(axes: "Axes", site: Site, x_right_m: float, y_m: float) -> None:
    """List the goal categories that stand here, with how many of each."""
    left = x_right_m - _legend_width_m(site)
    for goal, words, width in _legend_entries(site):
        box = [(left, y_m - 0.08), (left + 0.2, y_m - 0.08), (left + 0.2, y_m - 0.24), (left, y_m - 0.24)]
        _fill(axes, box, facecolor=GOAL_COLORS[goal], edgecolor="#4a4a48", linewidth=0.5, zorder=6)
        axes.text(left + 0.27, y_m - 0.16, words, ha="left", va="center", fontsize=6.5, color=_INK)
        left += width
