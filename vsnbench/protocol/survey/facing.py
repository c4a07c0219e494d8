"""What is wrong with the headings of a surveyed site: radians, clockwise ones, mirrored axes, fronts to the wall."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.site import Site, SiteObject
from vsnbench.protocol.survey.building import named_wall
from vsnbench.protocol.survey.finding import Amount, Severity, SiteFinding, points, shown
from vsnbench.protocol.survey.things import footprint_of
from vsnbench.protocol.walls import wall_area, wall_shapes

_FRONTED = frozenset({"sofa", "bed", "toilet", "monitor", "bookshelf", "cabinet", "counter", "refrigerator", "sink"})
_FRONTED |= {"stove", "wall_cabinet", "wardrobe", "washing_machine", "picture"}
"""Their front is never against a wall; a chair may face one."""
_AT_WALL_M = 0.35
"""A front this near to a wall is against it, when the back is not."""
_BACK_FREE_M = 0.25
"""So much farther from a wall than the front the back has to be."""
_FARTHEST_M = 30.0
_SUSPICIOUS = 3
"""So many things wrong together have one reason."""


@dataclass(frozen=True, slots=True)
class _Facing:
    """How far a thing's front and back are from the walls before and behind them."""

    front_m: float
    back_m: float
    wall: int

    @property
    def is_wrong(self) -> bool:
        return self.front_m < _AT_WALL_M and self.back_m > self.front_m + _BACK_FREE_M


def facing_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield what is wrong with headings, and with the axes that they are measured from."""
    radians = list(_radians(site))
    yield from radians
    yield from _mirrored(site)
    if radians:
        return
    walls = wall_shapes(site)
    tree = shapely.STRtree(walls)
    wrong = [(index, found) for index, found in _facings(site, walls, tree, 1.0) if found.is_wrong]
    if len(wrong) >= _SUSPICIOUS:
        clockwise = sum(found.is_wrong for _, found in _facings(site, walls, tree, -1.0))
        if clockwise <= len(wrong) / 4:
            things = [site.objects[index] for index, _ in wrong]
            yield SiteFinding(
                Severity.WARNING,
                "headings-clockwise",
                f"site {site.name}",
                f"has {len(wrong)} things that face a wall, and {clockwise or 'none'} with their headings negated",
                "headings run counter-clockwise from x: 90 is up, -90 is down; turn their signs",
                points(*(thing.position for thing in things)),
                entries=tuple(("objects", index) for index, _ in wrong),
            )
            return
    for index, found in wrong:
        thing = site.objects[index]
        name = "television " if thing.model == "television" and "television" not in thing.id else ""
        yield SiteFinding(
            Severity.WARNING,
            "faces-wall",
            f"{name}{thing.id}",
            f"at {shown(thing.position)} faces {named_wall(site, found.wall)}, {found.front_m:.2f} m before it",
            f"heading_deg is where its front looks: {math.remainder(thing.heading_deg + 180, 360):g} turns it around",
            footprint_of(thing),
            Amount(found.front_m),
            (("objects", index),),
        )


def _facings(
    site: Site, walls: list[BaseGeometry], tree: shapely.STRtree, sign: float
) -> Iterator[tuple[int, _Facing]]:
    """Yield how each thing with a front would stand to the walls, its headings times `sign`."""
    for index, thing in enumerate(site.objects):
        if thing.category in _FRONTED and thing.footprint is None:
            heading_rad = math.radians(sign * thing.heading_deg)
            front_m, wall = _before(thing, heading_rad, walls, tree)
            if front_m < _AT_WALL_M:
                back_m, _ = _before(thing, heading_rad + math.pi, walls, tree)
                yield index, _Facing(front_m, back_m, wall)


def _before(
    thing: SiteObject, heading_rad: float, walls: list[BaseGeometry], tree: shapely.STRtree
) -> tuple[float, int]:
    """Return how far the wall before a side of a thing is, and which; infinitely far where it is slanted."""
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
    """Yield a warning where the headings of the starts, of the things, or of both look like radians."""
    starts, things = ([each.heading_deg for each in listed] for listed in (site.starts, site.objects))
    for what, given in (("things and starts", starts + things), ("starts", starts), ("things", things)):
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
                f"headings are degrees, these look like radians: {example:g} is {math.degrees(example):.0f}",
            )
            return


def _mirrored(site: Site) -> Iterator[SiteFinding]:
    """Yield what is out of place together, and in place when an axis is mirrored or both are exchanged."""
    yield from _mirrored_list(site, "objects", [thing.shape for thing in site.objects])
    yield from _mirrored_list(site, "starts", [shapely.Point(each.position).buffer(0.1) for each in site.starts])


def _mirrored_list(site: Site, what: str, shapes: list[BaseGeometry]) -> Iterator[SiteFinding]:
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
        ("with y counted downwards", "negate y of them", (1, 0, 0, -1, 0, 0)),
        (f"with y counted down from {up:g}", f"write {up:g} - y for them", (1, 0, 0, -1, 0, up)),
        ("with x counted to the left", "negate x of them", (-1, 0, 0, 1, 0, 0)),
        (f"with x counted left from {right:g}", f"write {right:g} - x for them", (-1, 0, 0, 1, right, 0)),
        ("with x and y exchanged", "write [x, y], x to the right and y up on the plan", (0, 1, 1, 0, 0, 0)),
    ]
    left, number = min(
        (sum(misplaced([affinity.affine_transform(shape, matrix) for shape in shapes])), number)
        for number, (_, _, matrix) in enumerate(readings)
    )
    reading, mend, _ = readings[number]
    if left <= sum(out) / 4:
        where = [shape.centroid for shape, wrong in zip(shapes, out, strict=True) if wrong]
        yield SiteFinding(
            Severity.ERROR,
            "axes-mirrored",
            f"site {site.name}",
            f"has {sum(out)} of {len(shapes)} {what} outside the rooms or in walls, and {left or 'none'} {reading}",
            f"x runs to the right and y up: {mend}, and turn headings likewise",
            points(*((float(point.x), float(point.y)) for point in where)),
        )
