"""The furniture of a floor plan: what stands and hangs in it, goals in their colours, with its names."""

import math
from typing import TYPE_CHECKING

from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.site import Site, SiteObject
from vsnbench.report.plan.ink import Ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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

_FURNITURE_FILL, _FURNITURE_EDGE = "#e9e9e7", "#a3a3a0"
_LABEL_PT = 5.2
_DRAWN_LAST = frozenset({"monitor", "lamp"})
NOT_DRAWN = frozenset({"picture"})
_OVERHEAD_M = 1.2
"""What hangs higher than this is above the robot."""


def _drawing_order(thing: SiteObject) -> tuple[bool, float, bool]:
    """Rugs first; then from the floor up, so that a monitor is seen on its desk."""
    return thing.solid, thing.elevation_m + (thing.category in _DRAWN_LAST), thing.category in GOAL_CATEGORIES


def draw_furniture(ink: Ink, axes: "Axes", site: Site, *, highlight: str | None, labels: bool) -> None:
    """Draw what stands and hangs in a site: goals in their colours, all or only the one to `highlight`."""
    for thing in sorted(site.objects, key=_drawing_order):
        if thing.category in NOT_DRAWN:
            continue
        colored = thing.category in GOAL_COLORS and highlight in (None, thing.category)
        _draw_object(ink, thing, colored=colored)
        if labels and thing.solid and thing.elevation_m <= _OVERHEAD_M:
            _label(axes, thing, [other for other in site.objects if other.elevation_m > thing.elevation_m], colored)


def _draw_object(ink: Ink, thing: SiteObject, *, colored: bool) -> None:
    outline = list(thing.shape.exterior.coords)
    if not thing.solid:
        ink.fill(outline, face="#f0ebe4", edge="#d8cfc3", width_pt=0.5, layer=1)
        return
    overhead = thing.elevation_m > _OVERHEAD_M  # an outline, as architects draw it
    face = "none" if overhead else GOAL_COLORS[thing.category] if colored else _FURNITURE_FILL
    edge = "#4a4a48" if colored else _FURNITURE_EDGE
    ink.fill(outline, face=face, edge=edge, width_pt=0.6, layer=2, dashes=(0, (4, 2)) if overhead else None)
    _draw_front(ink, thing, edge)


def _draw_front(ink: Ink, thing: SiteObject, color: str) -> None:
    """Hint at which side a seat or a bed faces: its back, or the pillows, as a line."""
    share = {"chair": 0.16, "sofa": 0.24, "bed": 0.22, "toilet": 0.28}.get(thing.category)
    if share is None or thing.footprint is not None:
        return
    depth, width, _ = thing.size_m
    cos, sin = math.cos(thing.pose.heading_rad), math.sin(thing.pose.heading_rad)
    back = -depth / 2 + share * depth
    x, y = thing.position
    ends = [(x + cos * back - sin * side, y + sin * back + cos * side) for side in (-width / 2, width / 2)]
    ink.line(ends, color=color, width_pt=0.6, layer=2.1)


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
        if other.category in NOT_DRAWN or not other.shape.intersects(thing.shape):
            continue
        left, low, right, high = other.shape.bounds
        strips = [(x_min, y_min, left, y_max), (right, y_min, x_max, y_max)]
        strips += [(x_min, y_min, x_max, low), (x_min, high, x_max, y_max)]
        x_min, y_min, x_max, y_max = strip = max(strips, key=lambda each: (each[2] - each[0]) * (each[3] - each[1]))
    return strip
