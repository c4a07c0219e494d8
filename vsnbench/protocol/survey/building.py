"""What is wrong with the building of a surveyed site: rooms that no wall closes, walls and openings out of place."""

import itertools
import math
from collections.abc import Iterator

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.site import Door, Point, Room, Site, Wall, Window
from vsnbench.protocol.survey.finding import TOUCHING_M2, SiteFinding, between, error, shown, warning
from vsnbench.protocol.walls import walls_of

_RUN_TOGETHER_M = 0.04
"""Openings may share so much of their wall before they count as being in the same place."""
_BESIDE_M = 0.03
"""So far from a wall's footprint a room's edge may lie: surveys are not exact to a centimetre."""
_GAP_M = 0.05
"""Shorter stretches of a room's edge without a wall are a survey's rounding."""
_MEANT_M = 0.5
"""A wall no farther off than this is likely the one that was meant."""
_PARALLEL_RAD = math.radians(5)


def building_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield what is wrong with rooms, walls, doors and windows."""
    yield from _rooms(site)
    yield from _open_edges(site)
    yield from _walls(site)
    for door in site.doors:
        yield from _opening(site, door, door.name, door.height_m)
    for number, window in enumerate(site.windows, start=1):
        yield from _opening(site, window, f"window {number}", window.head_m)
    yield from _openings_in_one_place(site)
    yield from _doors_to_nowhere(site)


def _rooms(site: Site) -> Iterator[SiteFinding]:
    for one, other in itertools.combinations(site.rooms, 2):
        shared = one.shape.intersection(other.shape)
        if shared.area > TOUCHING_M2:
            yield error(
                f"rooms {one.name!r} and {other.name!r}",
                f"overlap by {shared.area:.2f} m² around {shown(_middle(shared))}",
                "rooms meet at the middle of the wall between them",
                _middle(shared),
            )


def _open_edges(site: Site) -> Iterator[SiteFinding]:
    """Yield every stretch of a room's edge that no wall covers; a stretch that two rooms share is named once."""
    covered = shapely.union_all([wall.shape for wall in site.walls]).buffer(_BESIDE_M, join_style="mitre")
    told: list[BaseGeometry] = []
    for room in site.rooms:
        corners = [*room.polygon, room.polygon[0]]
        for start, end in itertools.pairwise(corners):
            edge = shapely.LineString([start, end])
            for piece in shapely.get_parts(shapely.difference(edge, covered)):
                if piece.length <= _GAP_M or any(before.buffer(_BESIDE_M).covers(piece) for before in told):
                    continue
                told.append(piece)
                yield _open_edge(site, room, (start, end), piece)


def _open_edge(site: Site, room: Room, edge: tuple[Point, Point], piece: BaseGeometry) -> SiteFinding:
    (x0, y0), *_, (x1, y1) = piece.coords
    first, last = _widened((x0, y0), (x1, y1), edge), _widened((x1, y1), (x0, y0), edge)
    open_m, edge_m = math.dist(first, last), math.dist(*edge)
    whole = open_m > edge_m - _GAP_M
    problem = f"has no wall along its edge {between(*edge)}"
    if not whole:
        problem += f" for {open_m:.2f} m, {between(first, last)}"
    return error(f"room {room.name!r}", problem, _closing(site, first, last), first, last)


def _widened(end: Point, other: Point, edge: tuple[Point, Point]) -> Point:
    """Return the end of a gap without the tolerance that the walls beside it were grown by."""
    if min(math.dist(end, corner) for corner in edge) < 1e-6:
        return (float(end[0]), float(end[1]))
    share = _BESIDE_M / math.dist(end, other)
    return (float(end[0] + share * (end[0] - other[0])), float(end[1] + share * (end[1] - other[1])))


def _closing(site: Site, first: Point, last: Point) -> str:
    """Say how to close a gap: by the wall that was likely meant, else by a new one."""
    gap = shapely.LineString([first, last])
    for number, wall in enumerate(site.walls, start=1):
        if _angle_rad(first, last, wall) > _PARALLEL_RAD:
            continue
        face_m = float(wall.shape.distance(gap))
        beside = wall.centre_line.buffer(_MEANT_M + wall.thickness_m / 2, cap_style="flat").intersection(gap).length
        if beside > gap.length / 2 and face_m > 0:
            return f"move wall {number} ({between(wall.start, wall.end)}), which runs {face_m:.2f} m beside it"
        reach = wall.centre_line.buffer(_BESIDE_M + wall.thickness_m / 2, cap_style="square")
        if reach.distance(gap) < _BESIDE_M:
            end = min((wall.start, wall.end), key=lambda each: min(math.dist(each, first), math.dist(each, last)))
            return f"make wall {number} ({between(wall.start, wall.end)}) longer at {shown(end)}, or add a wall"
    return "add the wall; rooms without a wall between them are one room"


def _walls(site: Site) -> Iterator[SiteFinding]:
    for (i, one), (j, other) in itertools.combinations(enumerate(site.walls, start=1), 2):
        length_m = _shared_length_m(one, other)
        if length_m > 0:
            yield error(
                f"wall {i} ({between(one.start, one.end)}) and wall {j} ({between(other.start, other.end)})",
                f"overlap along {length_m:.2f} m",
                "shorten one of them",
                other.start,
                other.end,
            )
    for number, wall in enumerate(site.walls, start=1):
        if wall.height_m is not None and wall.height_m > site.ceiling_height_m + 1e-6:
            yield error(
                f"wall {number} ({between(wall.start, wall.end)})",
                f"is {wall.height_m:g} m high, {wall.height_m - site.ceiling_height_m:.2f} m above the ceiling",
                "leave height_m out for a wall up to the ceiling",
                wall.start,
                wall.end,
            )


def _shared_length_m(one: Wall, other: Wall) -> float:
    """Return along how many metres two walls run in the same place; 0 for walls that merely meet or cross."""
    if _angle_rad(one.start, one.end, other) > _PARALLEL_RAD:
        return 0.0
    strip = one.centre_line.buffer((one.thickness_m + other.thickness_m) / 2 - 1e-3, cap_style="flat")
    length_m = float(strip.intersection(other.centre_line).length)
    return length_m if length_m > (one.thickness_m + other.thickness_m) / 2 else 0.0


def _angle_rad(start: Point, end: Point, wall: Wall) -> float:
    """Return the angle between a stretch and a wall, 0 to pi/2."""
    across = (end[0] - start[0]) * (wall.end[1] - wall.start[1]) - (end[1] - start[1]) * (wall.end[0] - wall.start[0])
    return math.asin(min(1.0, abs(across) / (math.dist(start, end) * wall.length_m)))


def _opening(site: Site, opening: Door | Window, name: str, top_m: float) -> Iterator[SiteFinding]:
    ends = (opening.start, opening.end)
    walls = walls_of(site, *ends)
    if not walls:
        yield error(name, f"({between(*ends)}) lies on no wall", _nearest_wall(site, opening), *ends)
        return
    height_m = min(site.ceiling_height_m if wall.height_m is None else wall.height_m for wall in walls)
    if top_m > height_m + 1e-6:
        yield error(
            name,
            f"({between(*ends)}) reaches {top_m - height_m:.2f} m above its wall, which is {height_m:g} m high",
            "measure both again",
            *ends,
        )


def _nearest_wall(site: Site, opening: Door | Window) -> str:
    """Say how far the wall that was likely meant is."""

    def off_m(wall: Wall) -> float:
        return max(wall.centre_line.distance(shapely.Point(end)) for end in (opening.start, opening.end))

    number, wall = min(enumerate(site.walls, start=1), key=lambda each: off_m(each[1]))
    return (
        f"the centre line of wall {number} ({between(wall.start, wall.end)}) is {off_m(wall):.2f} m away; "
        "an opening's ends lie on it within 0.02 m"
    )


def _openings_in_one_place(site: Site) -> Iterator[SiteFinding]:
    openings = [(door.name, door.centre_line) for door in site.doors]
    openings += [(f"window {number}", window.centre_line) for number, window in enumerate(site.windows, start=1)]
    for (name, line), (other, other_line) in itertools.combinations(openings, 2):
        shared = line.buffer(0.01).intersection(other_line)
        if shared.length > _RUN_TOGETHER_M:
            yield error(
                f"{name} and {other}",
                f"overlap along {shared.length:.2f} m at {shown(_middle(shared))}",
                "measure the clear openings again",
                _middle(shared),
            )


def _doors_to_nowhere(site: Site) -> Iterator[SiteFinding]:
    rooms = shapely.union_all([room.shape for room in site.rooms])
    for door in site.doors:
        walls = walls_of(site, door.start, door.end)
        if door.closed or not walls:
            continue
        across_m = max(wall.thickness_m for wall in walls) / 2 + 0.1
        sides = [door.centre_line.parallel_offset(across_m, side) for side in ("left", "right")]
        if not all(rooms.intersects(side) for side in sides):
            yield warning(
                door.name,
                f"({between(door.start, door.end)}) stands open and leads out of every room",
                "mark it closed: true and shut it, or survey what lies behind",
                door.start,
                door.end,
            )


def _middle(shape: BaseGeometry) -> Point:
    return (float(shape.centroid.x), float(shape.centroid.y))
