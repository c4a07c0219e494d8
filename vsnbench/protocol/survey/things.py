"""What is wrong with the objects of a surveyed site: unknown, out of place, in each other's way."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.categories import CATEGORIES, meant_category
from vsnbench.protocol.site import Point, Site, SiteObject, Wall
from vsnbench.protocol.survey.finding import TOUCHING_M2, SiteFinding, between, error, shown, warning
from vsnbench.protocol.walls import wall_shapes

_ON_TOP_M = 0.05
"""An underside this near to the top of what it stands on, stands on it."""
_HANGS_M = 0.10
"""What has a wall this near hangs on it."""
_OFF_CENTRE_M = 0.3


def object_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield what is wrong with the things that stand in the site."""
    rooms = shapely.union_all([room.shape for room in site.rooms])
    walls = wall_shapes(site)
    for thing in site.objects:
        if thing.category not in CATEGORIES:
            yield _unknown(thing)
        yield from _place(site, thing, rooms, walls)
        yield from _height(site, thing, walls)
        yield from _outline(thing)
    solid = [thing for thing in site.objects if thing.solid]
    tree = shapely.STRtree([thing.shape for thing in solid])
    for first, second in sorted(zip(*tree.query(tree.geometries, predicate="intersects"), strict=True)):
        if first < second:
            yield from _in_each_other(solid[first], solid[second])


def _unknown(thing: SiteObject) -> SiteFinding:
    known = meant_category(thing.category)
    return error(thing.id, f"has the unknown category {thing.category!r}", known, thing.position)


def _place(site: Site, thing: SiteObject, rooms: BaseGeometry, walls: list[BaseGeometry]) -> Iterator[SiteFinding]:
    at = thing.position
    if not rooms.intersects(thing.shape):
        off_m = float(rooms.distance(thing.shape))
        problem = f"at {shown(at)} stands outside every room, {off_m:.2f} m from the nearest"
        yield error(thing.id, problem, "measure its position again", at)
        return
    inside = [(number, thing.shape.intersection(wall)) for number, wall in enumerate(walls, start=1)]
    deepest = max(inside, key=lambda each: each[1].area)
    if deepest[1].area > TOUCHING_M2:
        number, _ = deepest
        wall = site.walls[number - 1]
        yield error(
            thing.id,
            f"at {shown(at)} sticks {_into_m(thing, wall):.2f} m into wall {number} ({between(wall.start, wall.end)})",
            "move it by that much, or measure its size again",
            at,
        )
    elif thing.shape.difference(rooms).area > TOUCHING_M2 and not _mostly_wall(thing.shape.difference(rooms), walls):
        out = thing.shape.difference(rooms)
        yield error(thing.id, f"at {shown(at)} reaches {_depth_m(out):.2f} m out of the rooms", "move it", at)
    for door in site.doors:
        doorway = door.centre_line.buffer(0.05, cap_style="flat")
        blocked = thing.shape.intersection(doorway)
        if thing.solid and blocked.area > TOUCHING_M2:
            yield error(
                thing.id,
                f"stands in {_longest_m(blocked):.2f} m of the {door.clear_width_m:.2f} m opening of the {door.name}",
                "move it out of the way",
                at,
            )


def _into_m(thing: SiteObject, wall: Wall) -> float:
    """Return how far a thing reaches past the face of a wall that is on its side."""
    (x0, y0), (x1, y1) = wall.start, wall.end
    corners = np.asarray(thing.shape.exterior.coords)
    off_m = ((x1 - x0) * (corners[:, 1] - y0) - (y1 - y0) * (corners[:, 0] - x0)) / wall.length_m
    side = 1.0 if off_m[:-1].mean() >= 0 else -1.0
    return float(wall.thickness_m / 2 - (side * off_m).min())


def _mostly_wall(part: BaseGeometry, walls: list[BaseGeometry]) -> bool:
    return bool(part.difference(shapely.union_all(walls)).area <= TOUCHING_M2)


def _height(site: Site, thing: SiteObject, walls: list[BaseGeometry]) -> Iterator[SiteFinding]:
    top_m = thing.elevation_m + thing.size_m[2]
    if top_m > site.ceiling_height_m + 1e-6:
        yield error(
            thing.id,
            f"reaches {top_m - site.ceiling_height_m:.2f} m above the ceiling of {site.ceiling_height_m:g} m",
            "measure its height and elevation_m again",
            thing.position,
        )
    if thing.elevation_m <= _ON_TOP_M or min(wall.distance(thing.shape) for wall in walls) < _HANGS_M:
        return
    below = [other for other in site.objects if other is not thing and other.shape.intersects(thing.shape)]
    tops = [other.elevation_m + other.size_m[2] for other in below]
    if any(top >= thing.elevation_m - _ON_TOP_M for top in tops):
        return
    nearest_m = max(tops, default=0.0)
    yield warning(
        thing.id,
        f"at {shown(thing.position)} hangs {thing.elevation_m - nearest_m:.2f} m above what is under it",
        "measure elevation_m, its underside above the floor, again",
        thing.position,
    )


def _outline(thing: SiteObject) -> Iterator[SiteFinding]:
    """A surveyed outline and the box that the simulator shows have to be in the same place."""
    if thing.footprint is None:
        return
    middle = shapely.box(*thing.shape.bounds).centroid
    off_m = math.dist(thing.position, (middle.x, middle.y))
    if off_m > _OFF_CENTRE_M:
        yield warning(
            thing.id,
            f"has its position {shown(thing.position)} {off_m:.2f} m from the middle of its footprint",
            f"give {shown((middle.x, middle.y))}, or measure the footprint again",
            thing.position,
        )


def _in_each_other(one: SiteObject, other: SiteObject) -> Iterator[SiteFinding]:
    shared = one.shape.intersection(other.shape)
    if shared.area > TOUCHING_M2 and not _above(one, other) and not _above(other, one):
        at: Point = (float(shared.centroid.x), float(shared.centroid.y))
        yield error(
            f"{one.id} and {other.id}",
            f"overlap by {shared.area * 1e4:.0f} cm² at {shown(at)}",
            f"move one by {_depth_m(shared):.2f} m, or give what stands on the other its elevation_m",
            at,
        )


def _above(upper: SiteObject, lower: SiteObject) -> bool:
    return upper.elevation_m >= lower.elevation_m + lower.size_m[2] - 0.01


def _depth_m(part: BaseGeometry) -> float:
    """Return the short side of the smallest box around an overlap: by how much to move something out of it."""
    return min(_sides_m(part))


def _longest_m(part: BaseGeometry) -> float:
    return max(_sides_m(part))


def _sides_m(part: BaseGeometry) -> tuple[float, float]:
    corners = shapely.get_coordinates(part.minimum_rotated_rectangle)
    first, second, *_ = (math.dist(one, other) for one, other in itertools.pairwise(corners))
    return first, second
