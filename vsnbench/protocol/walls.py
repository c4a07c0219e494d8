"""A site on the floor plan: its walls, with the open doors cut out or not, what is solid, what lies above what.

Whoever judges, draws or maps a site goes by these; only how it then looks is each medium's own.
"""

from typing import TYPE_CHECKING

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.site import Site

if TYPE_CHECKING:
    from vsnbench.protocol.site import Point, SiteObject, Wall

TOUCH_HEIGHT_M = 1.2
"""What hangs higher passes above every robot that we know of; the depth guard looks no higher either."""


def wall_area(site: Site) -> BaseGeometry:
    """Return the footprint of all walls with no opening cut out, metres."""
    return shapely.union_all([wall.shape for wall in site.walls])


def bounds_of(site: Site) -> tuple[float, float, float, float]:
    """Return the least x and y and the greatest x and y of the walls, metres: what a plan of the site has to hold."""
    x_min, y_min, x_max, y_max = wall_area(site).bounds
    return float(x_min), float(y_min), float(x_max), float(y_max)


def wall_shapes(site: Site) -> list[BaseGeometry]:
    """Return the footprint of each wall with the open doors cut out of it, metres."""
    cut = [doorway(door.start, door.end) for door in site.doors if not door.closed]
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


def doorway(start: "Point", end: "Point") -> BaseGeometry:
    """Return the opening between two points as a strip wide enough to cut through any wall that it is on."""
    return shapely.LineString([start, end]).buffer(0.3, cap_style="flat")


def top_m(thing: "SiteObject") -> float:
    """Return how high above the floor a thing ends, metres."""
    return thing.elevation_m + thing.size_m[2]


def lowest_first(site: Site) -> list["SiteObject"]:
    """Return the things in the order in which a plan is drawn: what lies above what comes after it."""
    return sorted(site.objects, key=top_m)
