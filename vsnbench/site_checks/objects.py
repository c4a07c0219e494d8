"""Checks of objects: unknown categories, wrong places and heights, overlaps."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from vsnbench.site_checks.finding import TOUCHING_M2, Entry, Severity, SiteFinding, outline, point_text, points
from vsnbench.site_checks.walls import door_name, wall_name
from vsnbench.sites.categories import ALIASES, CATEGORIES, CATEGORY_WORD, near_category, suggest_category
from vsnbench.sites.fields import Point
from vsnbench.sites.geometry.walls import top_m, wall_shapes
from vsnbench.sites.site import Site, SiteObject, Wall

_ON_TOP_M = 0.05
"""Maximum gap between an object and the object that supports it."""
_HANGS_M = 0.10
"""Maximum distance from a wall to an object that hangs on it."""
_OFF_CENTRE_M = 0.3


def object_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield findings about the objects of a site."""
    rooms = shapely.union_all([room.shape for room in site.rooms])
    walls = wall_shapes(site)
    for index, thing in enumerate(site.objects):
        entry = ("objects", index)
        if thing.category not in CATEGORIES:
            yield from _category(thing, entry)
        yield from _place(site, thing, entry, rooms, walls)
        yield from _height(site, thing, entry, walls)
        yield from _footprint(thing, entry)
    solid = [(index, thing) for index, thing in enumerate(site.objects) if thing.solid]
    tree = shapely.STRtree([thing.shape for _, thing in solid])
    for first, second in sorted(zip(*tree.query(tree.geometries, predicate="intersects"), strict=True)):
        if first < second:
            (i, thing), (j, other) = solid[first], solid[second]
            yield from _overlap(thing, other, (("objects", i), ("objects", j)))


def _error(
    code: str, thing: SiteObject, problem: str, advice: str, amount: float | None, *entries: Entry
) -> SiteFinding:
    return SiteFinding(Severity.ERROR, code, thing.id, problem, advice, outline(thing.shape), amount, entries)


def _category(thing: SiteObject, entry: Entry) -> Iterator[SiteFinding]:
    """Report a category that is not a word, or that is probably a misspelt built-in one."""
    if not CATEGORY_WORD.fullmatch(thing.category) or thing.category in ALIASES:
        known = suggest_category(thing.category)
        yield _error("unknown-category", thing, f"has the unknown category {thing.category!r}", known, None, entry)
    elif near := near_category(thing.category):
        problem = f"has the category {thing.category!r}, which is not a built-in one"
        advice = f"did you mean {near}? Otherwise ignore this: the simulator draws it as a box"
        yield SiteFinding(
            Severity.WARNING, "near-category", thing.id, problem, advice, outline(thing.shape), None, (entry,)
        )


def _place(
    site: Site, thing: SiteObject, entry: Entry, rooms: BaseGeometry, walls: list[BaseGeometry]
) -> Iterator[SiteFinding]:
    at = point_text(thing.position)
    if not rooms.intersects(thing.shape):
        off_m = float(rooms.distance(thing.shape))
        problem = f"at {at} is outside every room, {off_m:.2f} m from the nearest"
        yield _error("object-outside", thing, problem, suggest_position(thing.position, rooms), off_m, entry)
        return
    inside = [float(thing.shape.intersection(wall).area) for wall in walls]
    deepest = max(range(len(walls)), key=lambda index: inside[index])
    out = thing.shape.difference(rooms)
    into_m = _depth_in_wall_m(thing, site.walls[deepest])
    if inside[deepest] > TOUCHING_M2 and into_m > site.survey_error_m:  # less is within the error of the survey
        problem = f"at {at} reaches {into_m:.2f} m into {wall_name(site, deepest)}"
        advice = _exchange_advice(thing, rooms, walls) or "move it by this distance, or measure its size again"
        yield _error("object-in-wall", thing, problem, advice, into_m, entry, ("walls", deepest))
    elif out.area > TOUCHING_M2 and out.difference(shapely.union_all(walls)).area > TOUCHING_M2:
        out_m = _depth_m(out)
        problem = f"at {at} reaches {out_m:.2f} m out of the rooms"
        yield _error("object-out-of-room", thing, problem, "move it", out_m, entry)
    for index, door in enumerate(site.doors):
        doorway = door.centre_line.buffer(0.05, cap_style="flat")
        blocked = thing.shape.intersection(doorway)
        if thing.solid and blocked.area > TOUCHING_M2:
            blocked_m = max(_sides_m(blocked))
            problem = f"blocks {blocked_m:.2f} m of the {door.length_m:.2f} m opening of {door_name(door)}"
            yield _error("object-in-doorway", thing, problem, "move it", blocked_m, entry, ("doors", index))


def suggest_position(position: Point, rooms: BaseGeometry) -> str:
    """Return advice for a position outside the rooms: a likely mistake that would put it into a room."""
    x_m, y_m = position
    for advice, other in (
        ("are x and y exchanged? {} is in a room", (y_m, x_m)),
        ("is a sign wrong? {} is in a room", (abs(x_m), abs(y_m))),
        ("is the decimal point in the wrong place? {} is in a room", (x_m / 10, y_m / 10)),
        ("is it in centimetres? {} is in a room", (x_m / 100, y_m / 100)),
        ("is x in centimetres? {} is in a room", (x_m / 100, y_m)),
        ("is y in centimetres? {} is in a room", (x_m, y_m / 100)),
    ):
        if other != position and rooms.contains(shapely.Point(other)):
            return advice.format(point_text(other))
    return "measure its position again"


def _exchange_advice(thing: SiteObject, rooms: BaseGeometry, walls: list[BaseGeometry]) -> str:
    """Return advice for an object in a wall that fits with depth and width exchanged, or an empty string."""
    if thing.footprint is not None or abs(thing.size_m[0] - thing.size_m[1]) < _HANGS_M:
        return ""
    shape = affinity.rotate(thing.shape, 90, origin=thing.position)
    if not rooms.covers(shape) or any(shape.intersection(wall).area > TOUCHING_M2 for wall in walls):
        return ""
    depth, width, height = thing.size_m
    return (
        f"with depth and width exchanged it fits: size_m: [{width:g}, {depth:g}, {height:g}] (depth along its heading "
        "first); otherwise move it by this distance"
    )


def _depth_in_wall_m(thing: SiteObject, wall: Wall) -> float:
    """Return how far an object reaches past the face of a wall on its side, metres."""
    (x0, y0), (x1, y1) = wall.start, wall.end
    corners = np.asarray(thing.shape.exterior.coords)
    off_m = ((x1 - x0) * (corners[:, 1] - y0) - (y1 - y0) * (corners[:, 0] - x0)) / wall.length_m
    side = 1.0 if off_m[:-1].mean() >= 0 else -1.0
    return float(wall.thickness_m / 2 - (side * off_m).min())


def _height(site: Site, thing: SiteObject, entry: Entry, walls: list[BaseGeometry]) -> Iterator[SiteFinding]:
    over_m = top_m(thing) - site.ceiling_height_m
    if over_m > 1e-6:
        problem = f"reaches {over_m:.2f} m above the ceiling of {site.ceiling_height_m:g} m"
        advice = "measure its height and its elevation_m again"
        if max(thing.size_m[:2]) <= site.ceiling_height_m and thing.size_m[2] > 1.5 * max(thing.size_m[:2]):
            advice += "; size_m is [depth along its heading, width, height]"
        yield _error("object-above-ceiling", thing, problem, advice, over_m, entry)
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
        f"at {point_text(thing.position)} is {gap_m:.2f} m above the floor or object under it",
        f"elevation_m is the height of its underside above the floor: {max(tops, default=0.0):g} without a gap",
        outline(thing.shape),
        gap_m,
        (entry,),
    )


def _footprint(thing: SiteObject, entry: Entry) -> Iterator[SiteFinding]:
    """Yield a warning if a surveyed outline is not where the simulator shows the object."""
    if thing.footprint is None:
        return
    middle = shapely.box(*thing.shape.bounds).centroid
    off_m = math.dist(thing.position, (middle.x, middle.y))
    if off_m > _OFF_CENTRE_M:
        advice = f"give {point_text((middle.x, middle.y))}, or measure the footprint again"
        if math.hypot(middle.x, middle.y) < _OFF_CENTRE_M:
            advice = "its corners look relative to its centre: a footprint is in the site's frame, so add the position"
        yield SiteFinding(
            Severity.WARNING,
            "footprint-elsewhere",
            thing.id,
            f"has its position {point_text(thing.position)} {off_m:.2f} m from the centre of its footprint",
            advice,
            outline(thing.shape),
            off_m,
            (entry,),
        )


def _overlap(thing: SiteObject, other: SiteObject, entries: tuple[Entry, ...]) -> Iterator[SiteFinding]:
    shared = thing.shape.intersection(other.shape)
    if shared.area <= TOUCHING_M2 or _above(thing, other) or _above(other, thing):
        return
    at: Point = (float(shared.centroid.x), float(shared.centroid.y))
    depth_m = _depth_m(shared)
    advice = f"move one of them by {depth_m:.2f} m, or give the upper one its elevation_m"
    small, large = sorted((thing, other), key=lambda solid: float(solid.shape.area))
    if shared.area > 0.9 * small.shape.area:
        advice = f"is {small.id} on {large.id}? Give it elevation_m: {top_m(large):g}"
        if thing.category == other.category and shared.area > 0.9 * large.shape.area:
            advice = "is this the same object twice? Delete one of them"
    around = shared.convex_hull
    place = outline(around) if around.geom_type == "Polygon" else points(at)
    yield SiteFinding(
        Severity.ERROR,
        "objects-overlap",
        f"{thing.id} and {other.id}",
        f"overlap by {shared.area * 1e4:.0f} cm² at {point_text(at)}",
        advice,
        place,
        depth_m,
        entries,
    )


def _above(upper: SiteObject, lower: SiteObject) -> bool:
    return upper.elevation_m >= top_m(lower) - 0.01


def _depth_m(part: BaseGeometry) -> float:
    """Return the short side of the smallest box around an overlap: the move that removes it."""
    return min(_sides_m(part))


def _sides_m(part: BaseGeometry) -> tuple[float, float]:
    corners = shapely.get_coordinates(part.minimum_rotated_rectangle)
    first, second, *_ = (math.dist(start, end) for start, end in itertools.pairwise(corners))
    return first, second
