"""What is wrong with the objects of a surveyed site: unknown, out of place, in each other's way."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.categories import CATEGORIES, meant_category
from vsnbench.protocol.site import Point, Site, SiteObject, Wall
from vsnbench.protocol.survey.building import named_door, named_wall
from vsnbench.protocol.survey.finding import (
    TOUCHING_M2,
    Amount,
    Entry,
    Place,
    PlaceKind,
    Severity,
    SiteFinding,
    area,
    points,
    shown,
)
from vsnbench.protocol.walls import top_m, wall_shapes

_ON_TOP_M = 0.05
"""An underside this near to the top of what it stands on, stands on it."""
_HANGS_M = 0.10
"""What has a wall this near hangs on it."""
_OFF_CENTRE_M = 0.3


def object_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield what is wrong with the things that stand in the site."""
    rooms = shapely.union_all([room.shape for room in site.rooms])
    walls = wall_shapes(site)
    for index, thing in enumerate(site.objects):
        entry = ("objects", index)
        if thing.category not in CATEGORIES:
            yield _unknown(thing, entry)
        yield from _place(site, thing, entry, rooms, walls)
        yield from _height(site, thing, entry, walls)
        yield from _outline(thing, entry)
    solid = [(index, thing) for index, thing in enumerate(site.objects) if thing.solid]
    tree = shapely.STRtree([thing.shape for _, thing in solid])
    for first, second in sorted(zip(*tree.query(tree.geometries, predicate="intersects"), strict=True)):
        if first < second:
            (i, one), (j, other) = solid[first], solid[second]
            yield from _in_each_other(one, other, (("objects", i), ("objects", j)))


def _error(
    code: str, thing: SiteObject, entry: Entry, problem: str, mend: str, amount: Amount | None = None
) -> SiteFinding:
    return SiteFinding(Severity.ERROR, code, thing.id, problem, mend, footprint_of(thing), amount, (entry,))


def footprint_of(thing: SiteObject) -> Place:
    """Return a thing's outline as a place."""
    corners = shapely.get_coordinates(thing.shape.exterior)[:-1]
    return area(*((float(x), float(y)) for x, y in corners))


def _unknown(thing: SiteObject, entry: Entry) -> SiteFinding:
    known = meant_category(thing.category)
    return _error("unknown-category", thing, entry, f"has the unknown category {thing.category!r}", known)


def _place(
    site: Site, thing: SiteObject, entry: Entry, rooms: BaseGeometry, walls: list[BaseGeometry]
) -> Iterator[SiteFinding]:
    at = shown(thing.position)
    if not rooms.intersects(thing.shape):
        off_m = float(rooms.distance(thing.shape))
        problem = f"at {at} stands outside every room, {off_m:.2f} m from the nearest"
        yield _error("object-outside", thing, entry, problem, elsewhere(thing.position, rooms), Amount(off_m))
        return
    inside = [float(thing.shape.intersection(wall).area) for wall in walls]
    deepest = max(range(len(walls)), key=lambda index: inside[index])
    out = thing.shape.difference(rooms)
    if inside[deepest] > TOUCHING_M2:
        into_m = _into_m(thing, site.walls[deepest])
        problem = f"at {at} sticks {into_m:.2f} m into {named_wall(site, deepest)}"
        mend = _turned(thing, rooms, walls) or "move it by that much, or measure its size again"
        finding = _error("object-in-wall", thing, entry, problem, mend, Amount(into_m))
        yield _also(finding, ("walls", deepest))
    elif out.area > TOUCHING_M2 and out.difference(shapely.union_all(walls)).area > TOUCHING_M2:
        out_m = _depth_m(out)
        yield _error(
            "object-out-of-room",
            thing,
            entry,
            f"at {at} reaches {out_m:.2f} m out of the rooms",
            "move it",
            Amount(out_m),
        )
    for index, door in enumerate(site.doors):
        doorway = door.centre_line.buffer(0.05, cap_style="flat")
        blocked = thing.shape.intersection(doorway)
        if thing.solid and blocked.area > TOUCHING_M2:
            blocked_m = _longest_m(blocked)
            problem = f"stands in {blocked_m:.2f} m of the {door.clear_width_m:.2f} m opening of {named_door(door)}"
            finding = _error("object-in-doorway", thing, entry, problem, "move it out of the way", Amount(blocked_m))
            yield _also(finding, ("doors", index))


def _also(finding: SiteFinding, entry: Entry) -> SiteFinding:
    return replace(finding, entries=(*finding.entries, entry))


def elsewhere(position: Point, rooms: BaseGeometry) -> str:
    """Say where a position outside the rooms would lie in them with its numbers read otherwise."""
    x_m, y_m = position
    for mend, other in (
        ("are x and y exchanged? {} is in a room", (y_m, x_m)),
        ("is a sign wrong? {} is in a room", (abs(x_m), abs(y_m))),
        ("is the decimal point in the wrong place? {} is in a room", (x_m / 10, y_m / 10)),
        ("is it in centimetres? {} is in a room", (x_m / 100, y_m / 100)),
        ("is x in centimetres? {} is in a room", (x_m / 100, y_m)),
        ("is y in centimetres? {} is in a room", (x_m, y_m / 100)),
    ):
        if other != position and rooms.contains(shapely.Point(other)):
            return mend.format(shown(other))
    return "measure its position again"


def _turned(thing: SiteObject, rooms: BaseGeometry, walls: list[BaseGeometry]) -> str:
    """Say so where a thing that sticks in a wall would fit with depth and width exchanged."""
    if thing.footprint is not None or abs(thing.size_m[0] - thing.size_m[1]) < _HANGS_M:
        return ""
    shape = affinity.rotate(thing.shape, 90, origin=thing.position)
    if not rooms.covers(shape) or any(shape.intersection(wall).area > TOUCHING_M2 for wall in walls):
        return ""
    depth, width, height = thing.size_m
    return (
        f"with depth and width exchanged it fits: size_m: [{width:g}, {depth:g}, {height:g}], depth along its heading "
        "first; else move it by that much"
    )


def _into_m(thing: SiteObject, wall: Wall) -> float:
    """Return how far a thing reaches past the face of a wall that is on its side."""
    (x0, y0), (x1, y1) = wall.start, wall.end
    corners = np.asarray(thing.shape.exterior.coords)
    off_m = ((x1 - x0) * (corners[:, 1] - y0) - (y1 - y0) * (corners[:, 0] - x0)) / wall.length_m
    side = 1.0 if off_m[:-1].mean() >= 0 else -1.0
    return float(wall.thickness_m / 2 - (side * off_m).min())


def _height(site: Site, thing: SiteObject, entry: Entry, walls: list[BaseGeometry]) -> Iterator[SiteFinding]:
    over_m = top_m(thing) - site.ceiling_height_m
    if over_m > 1e-6:
        problem = f"reaches {over_m:.2f} m above the ceiling of {site.ceiling_height_m:g} m"
        mend = "measure its height and elevation_m again"
        if max(thing.size_m[:2]) <= site.ceiling_height_m and thing.size_m[2] > 1.5 * max(thing.size_m[:2]):
            mend += "; size_m is [depth along its heading, width, height]"
        yield _error("object-above-ceiling", thing, entry, problem, mend, Amount(over_m))
    if thing.elevation_m <= _ON_TOP_M or min(wall.distance(thing.shape) for wall in walls) < _HANGS_M:
        return
    below = [other for other in site.objects if other is not thing and other.shape.intersects(thing.shape)]
    tops = [top_m(other) for other in below]
    if any(top >= thing.elevation_m - _ON_TOP_M for top in tops):
        return
    gap_m = thing.elevation_m - max(tops, default=0.0)
    yield SiteFinding(
        Severity.WARNING,
        "object-in-air",
        thing.id,
        f"at {shown(thing.position)} hangs {gap_m:.2f} m above what is under it",
        f"elevation_m is its underside above the floor: {max(tops, default=0.0):g} where it stands on that",
        footprint_of(thing),
        Amount(gap_m),
        (entry,),
    )


def _outline(thing: SiteObject, entry: Entry) -> Iterator[SiteFinding]:
    """A surveyed outline and the box that the simulator shows have to be in the same place."""
    if thing.footprint is None:
        return
    middle = shapely.box(*thing.shape.bounds).centroid
    off_m = math.dist(thing.position, (middle.x, middle.y))
    if off_m > _OFF_CENTRE_M:
        mend = f"give {shown((middle.x, middle.y))}, or measure the footprint again"
        if math.hypot(middle.x, middle.y) < _OFF_CENTRE_M:
            mend = "its corners look measured from its own middle: a footprint is in the site's frame, add position"
        yield SiteFinding(
            Severity.WARNING,
            "footprint-elsewhere",
            thing.id,
            f"has its position {shown(thing.position)} {off_m:.2f} m from the middle of its footprint",
            mend,
            footprint_of(thing),
            Amount(off_m),
            (entry,),
        )


def _in_each_other(one: SiteObject, other: SiteObject, entries: tuple[Entry, ...]) -> Iterator[SiteFinding]:
    shared = one.shape.intersection(other.shape)
    if shared.area <= TOUCHING_M2 or _above(one, other) or _above(other, one):
        return
    at: Point = (float(shared.centroid.x), float(shared.centroid.y))
    depth_m = _depth_m(shared)
    mend = f"move one by {depth_m:.2f} m, or give what stands on the other its elevation_m"
    small, large = sorted((one, other), key=lambda each: float(each.shape.area))
    if shared.area > 0.9 * small.shape.area:
        mend = f"{small.id} stands on {large.id}? Give it elevation_m: {top_m(large):g}"
        if one.category == other.category and shared.area > 0.9 * large.shape.area:
            mend = "the same thing surveyed twice? Delete one"
    outline = shapely.get_coordinates(shared.convex_hull)[:-1]
    place = Place(PlaceKind.AREA, tuple((float(x), float(y)) for x, y in outline)) if len(outline) > 2 else points(at)
    yield SiteFinding(
        Severity.ERROR,
        "objects-overlap",
        f"{one.id} and {other.id}",
        f"overlap by {shared.area * 1e4:.0f} cm² at {shown(at)}",
        mend,
        place,
        Amount(depth_m),
        entries,
    )


def _above(upper: SiteObject, lower: SiteObject) -> bool:
    return upper.elevation_m >= top_m(lower) - 0.01


def _depth_m(part: BaseGeometry) -> float:
    """Return the short side of the smallest box around an overlap: by how much to move something out of it."""
    return min(_sides_m(part))


def _longest_m(part: BaseGeometry) -> float:
    return max(_sides_m(part))


def _sides_m(part: BaseGeometry) -> tuple[float, float]:
    corners = shapely.get_coordinates(part.minimum_rotated_rectangle)
    first, second, *_ = (math.dist(one, other) for one, other in itertools.pairwise(corners))
    return first, second
