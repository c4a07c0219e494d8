"""What is wrong with the rooms of a surveyed site: edges without a wall, overlaps, walls around no room."""

import itertools
import math
from collections.abc import Iterator

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.site import Point, Site
from vsnbench.protocol.survey.building import angle_rad, named_wall
from vsnbench.protocol.survey.finding import (
    TOUCHING_M2,
    Amount,
    Entry,
    Place,
    Severity,
    SiteFinding,
    area,
    between,
    points,
    shown,
    stretch,
)
from vsnbench.protocol.walls import wall_area

_BESIDE_M = 0.03
"""So far from a wall's footprint a room's edge may lie: surveys are not exact to a centimetre."""
_GAP_M = 0.05
"""Shorter stretches of a room's edge without a wall are a survey's rounding."""
_MEANT_M = 0.5
"""A wall no farther off than this is likely the one that was meant."""
_PARALLEL_RAD = math.radians(5)
_MEETS_M = 0.2
"""A gap that ends so near to a corner ends at the wall that is there."""
_SHAFT_M2 = 0.7
"""Smaller enclosures without a room are shafts and chimneys."""
_LARGEST_ROOM_M2 = 600.0


def room_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield what is wrong with the rooms' outlines and what closes them."""
    yield from _overlaps(site)
    yield from _open_edges(site)
    yield from _enclosures(site)
    for index, room in enumerate(site.rooms):
        if room.shape.area > _LARGEST_ROOM_M2:
            yield SiteFinding(
                Severity.WARNING,
                "room-very-large",
                f"room `{room.name}`",
                f"has {room.shape.area:.0f} m²",
                "lengths are metres: was it surveyed in decimetres or feet?",
                area(*room.polygon),
                Amount(room.shape.area, "m2"),
                (("rooms", index),),
            )


def _overlaps(site: Site) -> Iterator[SiteFinding]:
    for (i, one), (j, other) in itertools.combinations(enumerate(site.rooms), 2):
        shared = one.shape.intersection(other.shape)
        if shared.area > TOUCHING_M2:
            middle: Point = (float(shared.centroid.x), float(shared.centroid.y))
            inside = next((a.name for a, b in ((one, other), (other, one)) if b.shape.buffer(0.01).covers(a.shape)), "")
            mend = "rooms meet at the middle of the wall between them"
            if inside:
                mend = f"{inside} lies wholly in the other: cut it out of that one's polygon; {mend}"
            yield SiteFinding(
                Severity.ERROR,
                "rooms-overlap",
                f"rooms `{one.name}` and `{other.name}`",
                f"overlap by {shared.area:.2f} m² around {shown(middle)}",
                mend,
                _outline(shared),
                Amount(float(shared.area), "m2"),
                (("rooms", i), ("rooms", j)),
            )


def _open_edges(site: Site) -> Iterator[SiteFinding]:
    """Yield every stretch of a room's edge that no wall covers; a stretch that two rooms share is named once."""
    covered = wall_area(site).buffer(_BESIDE_M, join_style="mitre")
    told: list[BaseGeometry] = []
    for index, room in enumerate(site.rooms):
        corners = [*room.polygon, room.polygon[0]]
        for start, end in itertools.pairwise(corners):
            if start == end:
                continue
            edge = shapely.LineString([start, end])
            for piece in shapely.get_parts(shapely.difference(edge, covered)):
                if piece.length <= _GAP_M or any(before.buffer(_BESIDE_M).covers(piece) for before in told):
                    continue
                told.append(piece)
                yield _open_edge(site, index, (start, end), piece)


def _open_edge(site: Site, room: int, edge: tuple[Point, Point], piece: BaseGeometry) -> SiteFinding:
    (x0, y0), *_, (x1, y1) = piece.coords
    first, last = _widened((x0, y0), (x1, y1), edge), _widened((x1, y1), (x0, y0), edge)
    open_m = math.dist(first, last)
    problem = "has no wall"
    start, end = (_snapped(point, edge) for point in (first, last))
    if {start, end} != set(edge):
        problem += f" for {open_m:.2f} m, {between(first, last)}"
    mend, walls = _closing(site, first, last, (start, end))
    return SiteFinding(
        Severity.ERROR,
        "edge-without-wall",
        f"the {site.rooms[room].name}'s edge {between(*edge)}",
        problem,
        mend,
        stretch(start, end),
        Amount(open_m),
        (("rooms", room), *walls),
    )


def _snapped(point: Point, edge: tuple[Point, Point]) -> Point:
    """Return the corner that a gap ends at, where only a wall that meets it lies between."""
    corner = min(edge, key=lambda each: math.dist(each, point))
    return corner if math.dist(corner, point) < _MEETS_M else point


def _widened(end: Point, other: Point, edge: tuple[Point, Point]) -> Point:
    """Return the end of a gap without the tolerance that the walls beside it were grown by."""
    if min(math.dist(end, corner) for corner in edge) < 1e-6:
        return (float(end[0]), float(end[1]))
    share = _BESIDE_M / math.dist(end, other)
    return (float(end[0] + share * (end[0] - other[0])), float(end[1] + share * (end[1] - other[1])))


def _closing(site: Site, first: Point, last: Point, meant: tuple[Point, Point]) -> tuple[str, tuple[Entry, ...]]:
    """Say how to close a gap: by the wall that was likely meant, else by a new one."""
    gap = shapely.LineString([first, last])
    for index, wall in enumerate(site.walls):
        if angle_rad(first, last, wall) > _PARALLEL_RAD:
            continue
        entry = (("walls", index),)
        face_m = float(wall.shape.distance(gap))
        beside = wall.centre_line.buffer(_MEANT_M + wall.thickness_m / 2, cap_style="flat").intersection(gap).length
        if beside > gap.length / 2 and face_m > 0:
            return f"move {named_wall(site, index)}, which runs {face_m:.2f} m beside it", entry
        reach = wall.centre_line.buffer(_BESIDE_M + wall.thickness_m / 2, cap_style="square")
        if reach.distance(gap) < _BESIDE_M:
            end = min((wall.start, wall.end), key=lambda each: min(math.dist(each, first), math.dist(each, last)))
            return f"make {named_wall(site, index)} longer at {shown(end)}, or add a wall", entry
    (x0, y0), (x1, y1) = ([round(value, 2) + 0.0 for value in point] for point in meant)
    line = f"- {{ start: [{x0:g}, {y0:g}], end: [{x1:g}, {y1:g}] }}"
    return f"add it to walls, {line}; rooms without a wall between them are one room", ()


def _enclosures(site: Site) -> Iterator[SiteFinding]:
    """Yield what walls shut in all around where no room is."""
    solid = wall_area(site).buffer(1e-3, join_style="mitre")
    rooms = shapely.union_all([room.shape for room in site.rooms]).buffer(_BESIDE_M, join_style="mitre")
    for part in shapely.get_parts(solid):
        for hole in part.interiors:
            inside = shapely.Polygon(hole)
            bare = inside.difference(rooms).difference(solid)
            for piece in shapely.get_parts(bare):
                if piece.area <= _SHAFT_M2:
                    continue
                at: Point = tuple(float(value) for value in piece.representative_point().coords[0])  # type: ignore[assignment]
                # The faces of the walls: their middle is half a thickness farther out, which the edges' check allows.
                corners = [(round(x, 2) + 0.0, round(y, 2) + 0.0) for x, y in _corners(piece)]
                outline = ", ".join(f"[{x:g}, {y:g}]" for x, y in corners)
                yield SiteFinding(
                    Severity.WARNING,
                    "enclosure-without-room",
                    f"what walls enclose around {shown(at)}",
                    f"is {piece.area:.1f} m² and in no room",
                    f"add it to rooms, polygon: [{outline}]",
                    area(*corners) if corners else points(at),
                    Amount(float(piece.area), "m2"),
                )


def _corners(piece: BaseGeometry) -> list[Point]:
    return [
        (float(x), float(y)) for x, y in shapely.get_coordinates(shapely.get_exterior_ring(piece.simplify(0.02)))[:-1]
    ]


def _outline(shape: BaseGeometry) -> Place:
    largest = max(shapely.get_parts(shape), key=lambda part: float(part.area))
    return area(*_corners(largest))
