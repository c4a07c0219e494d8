"""Shapes of a site on the floor plan: walls with and without doors, solid objects, drawing order."""

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.sites.fields import Point
from vsnbench.sites.site import Site, SiteObject, Wall

TOUCH_HEIGHT_M = 1.2
"""Objects above this height do not touch robots; also the default upper limit of the depth guard."""


def wall_area(site: Site) -> BaseGeometry:
    """Return the footprint of all walls without openings, metres."""
    return shapely.union_all([wall.shape for wall in site.walls])


def bounds_of(site: Site) -> tuple[float, float, float, float]:
    """Return minimum x and y and maximum x and y of the walls, metres."""
    x_min, y_min, x_max, y_max = wall_area(site).bounds
    return float(x_min), float(y_min), float(x_max), float(y_max)


def wall_shapes(site: Site) -> list[BaseGeometry]:
    """Return the footprint of each wall with open doors cut out, metres."""
    cut = [door.opening for door in site.doors if not door.closed]
    openings = shapely.union_all(cut) if cut else shapely.Polygon()
    return [wall.shape.difference(openings) for wall in site.walls]


def solid_shapes(site: Site, below_m: float = TOUCH_HEIGHT_M) -> list[BaseGeometry]:
    """Return the footprints that a robot of height `below_m` can touch: walls, then those of `solid_objects`."""
    return [*wall_shapes(site), *(thing.shape for thing in solid_objects(site, below_m))]


def solid_objects(site: Site, below_m: float = TOUCH_HEIGHT_M) -> list[SiteObject]:
    """Return the objects that a robot of height `below_m` can touch."""
    return [thing for thing in site.objects if thing.solid and thing.elevation_m < below_m]


def walls_of(site: Site, start: Point, end: Point, tolerance_m: float = 0.02) -> list[Wall]:
    """Return the walls whose centre line contains both points: the walls of a door or window."""
    line = shapely.LineString([start, end])
    return [wall for wall in site.walls if wall.centre_line.buffer(tolerance_m, cap_style="square").covers(line)]


def top_m(thing: SiteObject) -> float:
    """Return the height of an object's top above the floor, metres."""
    return thing.elevation_m + thing.size_m[2]


def lowest_first(site: Site) -> list[SiteObject]:
    """Return the objects in drawing order: upper ones after lower ones."""
    return sorted(site.objects, key=top_m)
