"""Checks of rooms: edges without a wall, overlaps, enclosed areas without a room."""

import itertools
import math
from collections.abc import Iterator

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.site_checks.finding import (
    TOUCHING_M2,
    Entry,
    Severity,
    SiteFinding,
    area,
    outline,
    point_text,
    range_text,
    stretch,
)
from vsnbench.site_checks.walls import angle_rad, wall_name
from vsnbench.sites.fields import Point
from vsnbench.sites.geometry.walls import wall_area
from vsnbench.sites.site import Site, Wall

_EDGE_TOLERANCE_M = 0.03
"""Maximum distance from a wall's footprint to a room's edge; surveys are not exact to a centimetre."""
_SHORTEST_GAP_M = 0.05
"""Shorter gaps between an edge and its wall are rounding of the survey."""
_FARTHEST_WALL_M = 0.5
"""Maximum distance from an edge to the wall that was likely meant."""
_PARALLEL_RAD = math.radians(5)
_CORNER_M = 0.2
"""Maximum distance from a corner to a gap that ends at the corner's other wall."""
_SHAFT_M2 = 0.7
"""Smaller enclosed areas without a room are shafts and chimneys."""
_LARGEST_ROOM_M2 = 600.0


def room_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield findings about the rooms' outlines and their walls."""
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
                room.shape.area,
                (("rooms", index),),
                "m2",
            )


def _overlaps(site: Site) -> Iterator[SiteFinding]:
    for (i, room), (j, other) in itertools.combinations(enumerate(site.rooms), 2):
        shared = room.shape.intersection(other.shape)
        if shared.area > TOUCHING_M2:
            middle: Point = (float(shared.centroid.x), float(shared.centroid.y))
            pairs = ((room, other), (other, room))
            inside = next((inner.name for inner, outer in pairs if outer.shape.buffer(0.01).covers(inner.shape)), "")
            advice = "rooms meet at the middle of the wall between them"
            if inside:
                advice = f"{inside} is inside the other room: cut it out of the outer polygon; {advice}"
            yield SiteFinding(
                Severity.ERROR,
                "rooms-overlap",
                f"rooms `{room.name}` and `{other.name}`",
                f"overlap by {shared.area:.2f} m² around {point_text(middle)}",
                advice,
                outline(max(shapely.get_parts(shared), key=lambda part: float(part.area)).simplify(0.02)),
                float(shared.area),
                (("rooms", i), ("rooms", j)),
                "m2",
            )


def _open_edges(site: Site) -> Iterator[SiteFinding]:
    """Yield each part of a room's edge without a wall; a part that two rooms share is reported once."""
    covered = wall_area(site).buffer(_EDGE_TOLERANCE_M, join_style="mitre")
    reported: list[BaseGeometry] = []
    for index, room in enumerate(site.rooms):
        corners = [*room.polygon, room.polygon[0]]
        for start, end in itertools.pairwise(corners):
            if start == end:
                continue
            edge = shapely.LineString([start, end])
            for piece in shapely.get_parts(shapely.difference(edge, covered)):
                if piece.length <= _SHORTEST_GAP_M or any(
                    before.buffer(_EDGE_TOLERANCE_M).covers(piece) for before in reported
                ):
                    continue
                reported.append(piece)
                yield _open_edge(site, index, (start, end), piece)


def _open_edge(site: Site, room: int, edge: tuple[Point, Point], piece: BaseGeometry) -> SiteFinding:
    (x0, y0), *_, (x1, y1) = piece.coords
    first, last = _without_tolerance((x0, y0), (x1, y1), edge), _without_tolerance((x1, y1), (x0, y0), edge)
    open_m = math.dist(first, last)
    problem = "has no wall"
    start, end = (_snap_to_corner(point, edge) for point in (first, last))
    if {start, end} != set(edge):
        problem += f" for {open_m:.2f} m, {range_text(first, last)}"
    corner = _corner_off_its_wall(site, edge, piece)
    advice, walls = corner or _closing_advice(site, first, last, (start, end))
    return SiteFinding(
        Severity.ERROR,
        "edge-without-wall",
        f"the {site.rooms[room].name}'s edge {range_text(*edge)}",
        problem,
        advice,
        stretch(start, end),
        open_m,
        (("rooms", room), *walls),
    )


def _snap_to_corner(point: Point, edge: tuple[Point, Point]) -> Point:
    """Return the corner near the end of a gap, or the end itself if no corner is near."""
    corner = min(edge, key=lambda endpoint: math.dist(endpoint, point))
    return corner if math.dist(corner, point) < _CORNER_M else point


def _without_tolerance(end: Point, other: Point, edge: tuple[Point, Point]) -> Point:
    """Return the end of a gap without the tolerance that was added to the adjacent wall."""
    if min(math.dist(end, corner) for corner in edge) < 1e-6:
        return (float(end[0]), float(end[1]))
    share = _EDGE_TOLERANCE_M / math.dist(end, other)
    return (float(end[0] + share * (end[0] - other[0])), float(end[1] + share * (end[1] - other[1])))


def _corner_off_its_wall(
    site: Site, edge: tuple[Point, Point], piece: BaseGeometry
) -> tuple[str, tuple[Entry, ...]] | None:
    """Return advice to move one corner of a skew edge onto the wall of its other corner, with the wall; None if no
    wall fits.

    The corner is wrong rather than the wall: other rooms may share the wall.
    """
    for index, wall in enumerate(site.walls):
        within_m = wall.thickness_m / 2 + _EDGE_TOLERANCE_M
        near, far = sorted(edge, key=lambda corner: _off_line_m(corner, wall))
        off_m = _off_line_m(far, wall)
        if _off_line_m(near, wall) > _EDGE_TOLERANCE_M or not within_m < off_m <= _FARTHEST_WALL_M:
            continue
        if angle_rad(*edge, wall) > _PARALLEL_RAD or wall.centre_line.distance(piece) > _FARTHEST_WALL_M:
            continue
        foot = _foot(far, wall)
        if any(wall.centre_line.distance(shapely.Point(end)) > _FARTHEST_WALL_M for end in (foot, near)):
            continue
        advice = f"move its corner {point_text(far)} to {point_text(foot)}, in line with {wall_name(site, index)}"
        return advice, (("walls", index),)
    return None


def _foot(point: Point, wall: Wall) -> Point:
    """Return the foot of the perpendicular from a point to the infinite line of a wall."""
    (x0, y0), (x1, y1) = wall.start, wall.end
    along = ((point[0] - x0) * (x1 - x0) + (point[1] - y0) * (y1 - y0)) / (math.dist(wall.start, wall.end) ** 2 or 1.0)
    return (x0 + along * (x1 - x0), y0 + along * (y1 - y0))


def _off_line_m(point: Point, wall: Wall) -> float:
    return math.dist(point, _foot(point, wall))


def _closing_advice(site: Site, first: Point, last: Point, meant: tuple[Point, Point]) -> tuple[str, tuple[Entry, ...]]:
    """Return advice to close a gap by the wall that was likely meant, else by a new wall."""
    gap = shapely.LineString([first, last])
    for index, wall in enumerate(site.walls):
        if angle_rad(first, last, wall) > _PARALLEL_RAD:
            continue
        entry = (("walls", index),)
        face_m = float(wall.shape.distance(gap))
        strip = wall.centre_line.buffer(_FARTHEST_WALL_M + wall.thickness_m / 2, cap_style="flat")
        if strip.intersection(gap).length > gap.length / 2 and face_m > 0:
            return f"move {wall_name(site, index)}, which is parallel at {face_m:.2f} m", entry
        reach = wall.centre_line.buffer(_EDGE_TOLERANCE_M + wall.thickness_m / 2, cap_style="square")
        if reach.distance(gap) < _EDGE_TOLERANCE_M:
            end = min(
                (wall.start, wall.end), key=lambda endpoint: min(math.dist(endpoint, first), math.dist(endpoint, last))
            )
            return f"extend {wall_name(site, index)} at {point_text(end)}, or add a wall", entry
    (x0, y0), (x1, y1) = ([round(value, 2) + 0.0 for value in point] for point in meant)
    line = f"- {{ start: [{x0:g}, {y0:g}], end: [{x1:g}, {y1:g}] }}"
    return f"add the wall {line}, or join the rooms if there is no wall", ()


def _enclosures(site: Site) -> Iterator[SiteFinding]:
    """Yield each area that walls enclose and no room covers."""
    solid = wall_area(site).buffer(1e-3, join_style="mitre")
    rooms = shapely.union_all([room.shape for room in site.rooms]).buffer(_EDGE_TOLERANCE_M, join_style="mitre")
    for part in shapely.get_parts(solid):
        for hole in part.interiors:
            inside = shapely.Polygon(hole)
            bare = inside.difference(rooms).difference(solid)
            for piece in shapely.get_parts(bare):
                if piece.area <= _SHAFT_M2:
                    continue
                at: Point = tuple(float(value) for value in piece.representative_point().coords[0])  # type: ignore[assignment]
                # Corners on the walls' faces: centre lines are half a thickness outside, which `_open_edges` allows.
                corners = [(round(x, 2) + 0.0, round(y, 2) + 0.0) for x, y in outline(piece.simplify(0.02)).points]
                polygon = ", ".join(f"[{x:g}, {y:g}]" for x, y in corners)
                yield SiteFinding(
                    Severity.WARNING,
                    "enclosure-without-room",
                    f"the enclosed area around {point_text(at)}",
                    f"has {piece.area:.1f} m² and is not in a room",
                    f"add it to rooms with polygon: [{polygon}]",
                    area(*corners),
                    float(piece.area),
                    unit="m2",
                )
