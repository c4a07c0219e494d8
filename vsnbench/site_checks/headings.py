"""Checks of headings and axes: radians, clockwise headings, mirrored axes, objects that face a wall."""

import math
from collections.abc import Iterator, Sequence

import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from vsnbench.site_checks.finding import Severity, SiteFinding, outline, point_text, points
from vsnbench.site_checks.walls import wall_name
from vsnbench.sites.geometry.walls import wall_area, wall_shapes
from vsnbench.sites.site import Site, SiteObject

_FRONTED = frozenset({"sofa", "bed", "toilet", "monitor", "bookshelf", "cabinet", "counter", "refrigerator", "sink"})
_FRONTED |= {"stove", "wall_cabinet", "wardrobe", "washing_machine", "picture"}
"""Categories whose front is never against a wall."""
_AT_WALL_M = 0.35
"""Maximum distance from a wall to a front that is against it."""
_BACK_FREE_M = 0.25
"""Minimum difference of the distances of back and front from their walls."""
_FARTHEST_M = 30.0
_AS_WRITTEN_RAD = 0.002
"""Maximum difference between a written multiple of a quarter turn and its value: 3.14 for pi."""
_SUSPICIOUS = 3
"""Minimum number of errors that suggest one common cause."""


def heading_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield findings about headings and axes."""
    radians = list(_radians(site))
    yield from radians
    yield from _mirrored(site, "objects", [thing.shape for thing in site.objects])
    yield from _mirrored(site, "starts", [shapely.Point(start.position).buffer(0.1) for start in site.starts])
    if radians:
        return
    walls = wall_shapes(site)
    tree = shapely.STRtree(walls)
    wrong = list(_facing_walls(site, walls, tree, 1.0))
    if len(wrong) >= _SUSPICIOUS:
        clockwise = len(list(_facing_walls(site, walls, tree, -1.0)))
        if clockwise <= len(wrong) / 4:
            things = [site.objects[index] for index, _, _ in wrong]
            yield SiteFinding(
                Severity.WARNING,
                "headings-clockwise",
                f"site {site.name}",
                f"has {len(wrong)} objects that face a wall, and {clockwise or 'none'} with negated headings",
                "headings run counter-clockwise from x: 90 is up, -90 is down; negate them",
                points(*(thing.position for thing in things)),
                entries=tuple(("objects", index) for index, _, _ in wrong),
            )
            return
    for index, wall, front_m in wrong:
        thing = site.objects[index]
        name = "television " if thing.model == "television" and "television" not in thing.id else ""
        yield SiteFinding(
            Severity.WARNING,
            "faces-wall",
            f"{name}{thing.id}",
            f"at {point_text(thing.position)} faces {wall_name(site, wall)} at {front_m:.2f} m",
            f"heading_deg is the direction of its front: {math.remainder(thing.heading_deg + 180, 360):g} is opposite",
            outline(thing.shape),
            front_m,
            (("objects", index),),
        )


def _facing_walls(
    site: Site, walls: list[BaseGeometry], tree: shapely.STRtree, sign: float
) -> Iterator[tuple[int, int, float]]:
    """Yield each object with its front against a wall and its back free: its index, the wall's, and their distance.

    Headings are multiplied by `sign`.
    """
    for index, thing in enumerate(site.objects):
        if thing.category in _FRONTED and thing.footprint is None:
            heading_rad = math.radians(sign * thing.heading_deg)
            front_m, wall = _before(thing, heading_rad, walls, tree)
            if front_m < _AT_WALL_M:
                back_m, _ = _before(thing, heading_rad + math.pi, walls, tree)
                if back_m > front_m + _BACK_FREE_M:
                    yield index, wall, front_m


def _before(
    thing: SiteObject, heading_rad: float, walls: list[BaseGeometry], tree: shapely.STRtree
) -> tuple[float, int]:
    """Return distance and index of the wall in front of one side of an object; infinity and -1 without one."""
    x_m, y_m = thing.position
    ray = shapely.LineString(
        [(x_m, y_m), (x_m + _FARTHEST_M * math.cos(heading_rad), y_m + _FARTHEST_M * math.sin(heading_rad))]
    )
    here = shapely.Point(x_m, y_m)
    hits = [
        (float(here.distance(walls[index].intersection(ray))), int(index)) for index in tree.query(ray, "intersects")
    ]
    if not hits:
        return math.inf, -1
    away_m, wall = min(hits)
    return max(away_m - thing.size_m[0] / 2, 0.0), wall


def _radians(site: Site) -> Iterator[SiteFinding]:
    """Yield a warning if the headings of starts, objects or both look like radians."""
    starts, objects = ([entry.heading_deg for entry in entries] for entries in (site.starts, site.objects))
    for what, given in (("objects and starts", starts + objects), ("starts", starts), ("objects", objects)):
        small = [abs(heading) for heading in given if abs(heading) <= math.tau]
        slanted = [heading for heading in small if heading % 1 > 1e-6]
        turned = sum(abs(heading) > math.tau for heading in given)
        if len(slanted) > max(len(given) / 3, 2) and turned <= len(slanted) / 4:
            few = f"only {turned} of {len(given)} {what}" if turned else f"none of its {what}"
            example = max(slanted)
            yield SiteFinding(
                Severity.WARNING,
                "headings-in-radians",
                f"site {site.name}",
                f"turns {few} by more than {max(small):.2f}°",
                f"headings are degrees, these look like radians: {example:g} rad is {math.degrees(example):.0f}°",
            )
            return
    yield from _single_radians(site)


_MULTIPLES_DEG = tuple(multiple for multiple in range(-360, 361, 45) if multiple)


def _single_radians(site: Site) -> Iterator[SiteFinding]:
    """Yield a warning for each heading that is a multiple of 45 degrees in radians, such as 3.14 or -1.5708."""
    entries = [
        *(
            ("starts", place, f"start {start.number}", start.heading_deg, start.position)
            for place, start in enumerate(site.starts)
        ),
        *(("objects", place, thing.id, thing.heading_deg, thing.position) for place, thing in enumerate(site.objects)),
    ]
    for kind, place, name, given, position in entries:
        meant = min(_MULTIPLES_DEG, key=lambda multiple: abs(math.radians(multiple) - given))
        if given % 1 > 1e-6 and abs(math.radians(meant) - given) < _AS_WRITTEN_RAD:
            yield SiteFinding(
                Severity.WARNING,
                "headings-in-radians",
                name,
                f"has a heading of {given:g}°",
                f"headings are degrees, this looks like radians: {given:g} rad is {meant}°",
                points(position),
                entries=((kind, place),),
            )


def _mirrored(site: Site, what: str, shapes: list[BaseGeometry]) -> Iterator[SiteFinding]:
    """Yield an error if the objects or starts fit the rooms only with mirrored or exchanged axes."""
    rooms = shapely.union_all([room.shape for room in site.rooms])
    walls = wall_area(site).buffer(-0.02)
    x_min, y_min, x_max, y_max = rooms.bounds
    allowed = rooms.difference(walls).buffer(0.03)
    shapely.prepare(allowed)

    def misplaced(moved: Sequence[BaseGeometry]) -> list[bool]:
        return [not allowed.covers(shape) for shape in moved]

    out = misplaced(shapes)
    if sum(out) < max(_SUSPICIOUS, len(shapes) / 3):
        return
    up, right = y_max + y_min, x_max + x_min
    readings = [
        ("with y counted downwards", "negate their y", (1, 0, 0, -1, 0, 0)),
        (f"with y counted down from {up:g}", f"replace their y by {up:g} - y", (1, 0, 0, -1, 0, up)),
        ("with x counted to the left", "negate their x", (-1, 0, 0, 1, 0, 0)),
        (f"with x counted left from {right:g}", f"replace their x by {right:g} - x", (-1, 0, 0, 1, right, 0)),
        ("with x and y exchanged", "exchange their x and y", (0, 1, 1, 0, 0, 0)),
    ]
    left, number = min(
        (sum(misplaced([affinity.affine_transform(shape, matrix) for shape in shapes])), number)
        for number, (_, _, matrix) in enumerate(readings)
    )
    reading, advice, _ = readings[number]
    if left <= sum(out) / 4:
        where = [shape.centroid for shape, wrong in zip(shapes, out, strict=True) if wrong]
        yield SiteFinding(
            Severity.ERROR,
            "axes-mirrored",
            f"site {site.name}",
            f"has {sum(out)} of {len(shapes)} {what} outside the rooms or in walls, and {left or 'none'} {reading}",
            f"x runs to the right and y up: {advice}, and change their headings in the same way",
            points(*((float(point.x), float(point.y)) for point in where)),
        )
