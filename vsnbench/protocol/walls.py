"""The walls of a site on the floor plan, with the open doors cut out of them, and everything else that is solid."""

from typing import TYPE_CHECKING

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.site import Site

if TYPE_CHECKING:
    from vsnbench.protocol.site import Point, Wall

TOUCH_HEIGHT_M = 1.2
"""What hangs higher passes above every robot that we know of; the depth guard looks no higher either."""


def wall_shapes(site: Site) -> list[BaseGeometry]:
    """Return the footprint of each wall with the open doors cut out of it, metres."""
    cut = [_opening(door.start, door.end) for door in site.doors if not door.closed]
    openings = shapely.union_all(cut) if cut else shapely.Polygon()
    return [wall.shape.difference(openings) for wall in site.walls]


def solid_shapes(site: Site, below_m: float = TOUCH_HEIGHT_M) -> list[BaseGeometry]:
    """Return everything on the floor plan that a robot of height `below_m` can touch: walls and solid objects."""
    objects = [thing.shape for thing in site.objects if thing.solid and thing.elevation_m < below_m]
    return [*wall_shapes(site), *objects]


def walls_of(site: Site, start: "Point", end: "Point", tolerance_m: float = 0.02) -> list["Wall"]:
    """Return the walls on whose centre line both points lie: where a door or window between them is cut."""
    line = shapely.LineString([start, end])
    return [wall for wall in site.walls if wall.centre_line.buffer(tolerance_m, cap_style="square").covers(line)]


def _opening(start: "Point", end: "Point") -> BaseGeometry:
    """Return the doorway as a strip wide enough to cut through any wall that it is on."""
    return shapely.LineString([start, end]).buffer(0.3, cap_style="flat")
