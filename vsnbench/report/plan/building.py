"""Walls, windows, doors and room names of a floor plan."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from vsnbench.report.plan.furniture import NOT_DRAWN
from vsnbench.report.plan.ink import INK, Ink
from vsnbench.sites.geometry.walls import wall_area, walls_of
from vsnbench.sites.site import Door, Room, Site, Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FLOORS = {"wood": "#fbf8f2", "tiles": "#f1f5f7", "carpet": "#f7f3f5", "concrete": "#f4f4f2"}


def draw_building(ink: Ink, axes: "Axes", site: Site) -> None:
    """Draw the floors, walls, windows and doors."""
    for room in site.rooms:
        ink.fill(room.polygon, face=_FLOORS[room.floor], layer=0)
    _draw_walls(axes, site)
    for window in site.windows:
        _draw_window(ink, site, window)
    for door in site.doors:
        _draw_door(ink, site, door)


def _draw_walls(axes: "Axes", site: Site) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    solid = wall_area(site).difference(shapely.union_all([cut.opening for cut in (*site.doors, *site.windows)]))
    for part in shapely.get_parts(solid):
        rings = [Outline(list(ring.coords), closed=True) for ring in (part.exterior, *part.interiors)]
        outline = Outline.make_compound_path(*rings)
        axes.add_artist(PathPatch(outline, facecolor=INK, edgecolor=INK, linewidth=0.3, zorder=5))


@dataclass(frozen=True, slots=True)
class _Opening:
    """Geometry of a door or window: its ends, unit vectors along and to the left, half the wall's thickness."""

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

    def rectangle(self, along_m: tuple[float, float], left_m: tuple[float, float]) -> list[tuple[float, float]]:
        (near, far), (right, left) = along_m, left_m
        return [self.at(near, right), self.at(far, right), self.at(far, left), self.at(near, left)]


def _opening(site: Site, start: tuple[float, float], end: tuple[float, float]) -> _Opening:
    length = math.dist(start, end)
    along = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
    walls = walls_of(site, start, end)
    return _Opening(start, end, along, (-along[1], along[0]), walls[0].thickness_m / 2 if walls else 0.05)


def _draw_window(ink: Ink, site: Site, window: Window) -> None:
    opening, length = _opening(site, window.start, window.end), math.dist(window.start, window.end)
    half = opening.half_m
    ink.fill(opening.rectangle((0, length), (-half, half)), face="white", edge=INK, width_pt=0.7, layer=5)
    pane = (opening.at(0, 0), opening.at(length, 0))
    ink.line(pane, color=INK, width_pt=0.6, layer=5.1)


def _draw_door(ink: Ink, site: Site, door: Door) -> None:
    opening, length = _opening(site, door.start, door.end), door.length_m
    half = opening.half_m
    if door.closed:
        sill = opening.rectangle((0, length), (-half, half))
        leaf = opening.rectangle((0, length), (half - 0.05, half))
        ink.fill(sill, face="white", edge=INK, width_pt=0.5, layer=5)
        ink.fill(leaf, face="#8a8a88", edge=INK, width_pt=0.5, layer=5.1)
        return
    leaf = opening.rectangle((0, 0.04), (half, half + length))
    ink.fill(leaf, face="white", edge="#7a7a78", width_pt=0.6, layer=4)
    angles = [math.pi / 2 * step / 24 for step in range(25)]
    swing = [opening.at(length * math.cos(angle), half + length * math.sin(angle)) for angle in angles]
    ink.line(swing, color="#7a7a78", width_pt=0.5, layer=4)


def name_room(axes: "Axes", site: Site, room: Room) -> None:
    """Write the room's name where the furniture leaves most space."""
    half_wide, half_high = 0.045 * len(room.name) + 0.1, 0.14
    busy = [thing.shape for thing in site.objects if thing.category not in NOT_DRAWN]
    busy += [wall.shape for wall in site.walls]
    busy += [shapely.Point(start.position).buffer(0.3) for start in site.starts]
    for door in site.doors:
        busy.append(door.centre_line.buffer(door.length_m + 0.05, cap_style="flat"))
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
