"""Furniture of a floor plan, with goals in colour, and its labels."""

import math
from typing import TYPE_CHECKING

from vsnbench.report.plan.ink import Ink
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import Site, SiteObject
from vsnbench.sites.targets import targets_of

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
"""Colour of each goal category, the same in all figures."""

_OTHER_GOAL = "#e6c84f"
"""Colour of a searched object of another category."""
_FURNITURE_FILL, _FURNITURE_EDGE = "#e9e9e7", "#a3a3a0"
_LABEL_PT = 5.2
_DRAWN_LAST = frozenset({"monitor", "lamp"})
NOT_DRAWN = frozenset({"picture"})
_OVERHEAD_M = 1.2
"""Objects above this height are above the robot."""


def _drawing_order(thing: SiteObject) -> tuple[bool, float, bool]:
    """Rugs first, then by height, so that a monitor is drawn on top of its desk."""
    return thing.solid, thing.elevation_m + (thing.category in _DRAWN_LAST), thing.category in GOAL_CATEGORIES


def draw_furniture(ink: Ink, axes: "Axes", site: Site, *, highlight: str | None, labels: bool) -> None:
    """Draw the objects of a site; all goals are coloured, or only the targets of the one to `highlight`."""
    searched = None if highlight is None else {target.id for target in targets_of(site, highlight)}
    for thing in sorted(site.objects, key=_drawing_order):
        if thing.category in NOT_DRAWN:
            continue
        colored = thing.category in GOAL_COLORS if searched is None else thing.id in searched
        _draw_object(ink, thing, colored=colored)
        if labels and thing.solid and thing.elevation_m <= _OVERHEAD_M:
            _label(axes, thing, [other for other in site.objects if other.elevation_m > thing.elevation_m], colored)


def _draw_object(ink: Ink, thing: SiteObject, *, colored: bool) -> None:
    outline = list(thing.shape.exterior.coords)
    if not thing.solid:
        ink.fill(outline, face="#f0ebe4", edge="#d8cfc3", width_pt=0.5, layer=1)
        return
    overhead = thing.elevation_m > _OVERHEAD_M  # outline only, as in architectural plans
    face = "none" if overhead else GOAL_COLORS.get(thing.category, _OTHER_GOAL) if colored else _FURNITURE_FILL
    edge = "#4a4a48" if colored else _FURNITURE_EDGE
    ink.fill(outline, face=face, edge=edge, width_pt=0.6, layer=2, dashes=(0, (4, 2)) if overhead else None)
    _draw_front(ink, thing, edge)


def _draw_front(ink: Ink, thing: SiteObject, color: str) -> None:
    """Draw a line for the back of a seat or the pillows of a bed."""
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
    """Label an object where nothing covers it; if that is too small, only with `always`."""
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
    """Return the largest strip of the object's bounds that no object above it covers."""
    x_min, y_min, x_max, y_max = strip = thing.shape.bounds
    for other in above:
        if other.category in NOT_DRAWN or not other.shape.intersects(thing.shape):
            continue
        left, low, right, high = other.shape.bounds
        strips = [(x_min, y_min, left, y_max), (right, y_min, x_max, y_max)]
        strips += [(x_min, y_min, x_max, low), (x_min, high, x_max, y_max)]
        x_min, y_min, x_max, y_max = strip = max(strips, key=lambda box: (box[2] - box[0]) * (box[3] - box[1]))
    return strip
