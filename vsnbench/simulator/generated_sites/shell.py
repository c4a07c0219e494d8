"""Walls, doors and windows for a layout of rooms."""

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass

import shapely
from numpy.random import Generator
from shapely.geometry import LineString, Polygon

from vsnbench.simulator.generated_sites import palette
from vsnbench.simulator.generated_sites.layout import PlannedRoom, RoomKind
from vsnbench.sites.site import Door, Wall, Window

OUTER_THICKNESS_M = 0.2
INNER_THICKNESS_M = 0.1
_CORNER_M = 0.18
"""Minimum distance of openings from junctions of walls, for jambs and casings."""

Segment = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Shell:
    """Everything of a building except floors."""

    walls: tuple[Wall, ...]
    doors: tuple[Door, ...]
    windows: tuple[Window, ...]


def build_shell(rooms: tuple[PlannedRoom, ...], rng: Generator) -> Shell | None:
    """Return walls, doors and windows; None if a room cannot have a door."""
    outline = shapely.union_all([room.shape for room in rooms]).simplify(0)
    if not isinstance(outline, Polygon):
        return None
    doors = _doors(rooms, rng)
    front = _front_door(rooms, outline, rng)
    if doors is None or front is None:
        return None
    taken = LineString([front.start, front.end]).buffer(0.35)
    return Shell(_walls(rooms, outline, rng), (*doors, front), _windows(rooms, outline, taken, rng))


def _walls(rooms: tuple[PlannedRoom, ...], outline: Polygon, rng: Generator) -> tuple[Wall, ...]:
    color, outer_color = palette.wall(rng), palette.wall(rng)
    ring = list(shapely.orient_polygons(outline.buffer(OUTER_THICKNESS_M / 2, join_style="mitre")).exterior.coords)
    walls = [
        Wall(start=_point(*start), end=_point(*end), thickness_m=OUTER_THICKNESS_M, color=outer_color)
        for start, end in itertools.pairwise(ring)
    ]
    for (upright, at), spans in sorted(_inner_lines(rooms).items()):
        for low, high in spans:
            start, end = ((at, low), (at, high)) if upright else ((low, at), (high, at))
            own = palette.wall(rng) if rng.random() < 0.3 else color
            walls.append(Wall(start=start, end=end, thickness_m=INNER_THICKNESS_M, color=own))
    return tuple(walls)


def _inner_lines(rooms: tuple[PlannedRoom, ...]) -> dict[tuple[bool, float], list[Segment]]:
    """Return the longest straight lines between rooms: (upright, position) -> segments."""
    lines: dict[tuple[bool, float], list[Segment]] = defaultdict(list)
    for room, other in itertools.combinations(rooms, 2):
        for start, end in _shared(room.shape, other.shape):
            upright = math.isclose(start[0], end[0], abs_tol=1e-6)
            at, along = (round(start[0], 3), 1) if upright else (round(start[1], 3), 0)
            lines[upright, at].append((min(start[along], end[along]), max(start[along], end[along])))
    merged: dict[tuple[bool, float], list[Segment]] = {}
    for key, spans in lines.items():
        joined: list[Segment] = []
        for low, high in sorted(spans):
            if joined and low <= joined[-1][1] + 1e-6:
                joined[-1] = (joined[-1][0], max(joined[-1][1], high))
            else:
                joined.append((low, high))
        merged[key] = joined
    return merged


def _shared(room: Polygon, other: Polygon) -> list[tuple[Segment, Segment]]:
    """Return the straight segments of the boundary between two rooms."""
    common = shapely.line_merge(shapely.intersection(room.exterior, other.exterior))
    parts = [part for part in shapely.get_parts(common) if part.geom_type == "LineString"]
    return [
        (_point(*start), _point(*end))
        for part in parts
        for start, end in itertools.pairwise(part.simplify(0).coords)
        if math.dist(start, end) > 0.05
    ]


def _doors(rooms: tuple[PlannedRoom, ...], rng: Generator) -> list[Door] | None:
    """Give every room one door to a hub, and connect hubs by a wide doorway."""
    hubs = [room for room in rooms if room.hub]
    doors = []
    for room in rooms:
        if room is hubs[0]:
            continue
        wide = room.kind is RoomKind.CORRIDOR
        width = rng.uniform(0.9, 1.05) if wide else rng.uniform(0.72 if room.kind is RoomKind.BATHROOM else 0.8, 0.92)
        # Rooms along a corridor have their doors to it; the corridor itself is excluded.
        order = [hubs[0]] if wide else hubs[::-1]
        door = next((made for hub in order if (made := _door(room, hub, float(width), rng)) is not None), None)
        if door is None:
            return None
        doors.append(door)
    return doors


def _door(room: PlannedRoom, hub: PlannedRoom, width: float, rng: Generator) -> Door | None:
    stretches = [pair for pair in _shared(room.shape, hub.shape) if math.dist(*pair) >= width + 2 * _CORNER_M + 0.02]
    if not stretches:
        return None
    start, end = stretches[rng.integers(len(stretches))]
    low, high = _opening(math.dist(start, end), width, _CORNER_M, rng)
    ends = [_along(start, end, low), _along(start, end, high)]
    if rng.random() < 0.5:
        ends.reverse()
    return Door(name=f"{room.kind} door", start=ends[0], end=ends[1], height_m=2.0)


def _front_door(rooms: tuple[PlannedRoom, ...], outline: Polygon, rng: Generator) -> Door | None:
    hub = [room for room in rooms if room.hub][-1]
    edges = _outer_edges(hub, outline)
    edges = [edge for edge in edges if math.dist(*edge) > 0.9 + 2 * _CORNER_M]
    if not edges:
        return None
    start, end = edges[rng.integers(len(edges))]
    length = math.dist(start, end)
    low = float(rng.uniform(_CORNER_M, min(0.6, length - 0.9 - _CORNER_M)))
    if rng.random() < 0.5:
        low = length - 0.88 - low
    return Door(
        name="front door",
        start=_along(start, end, low),
        end=_along(start, end, low + 0.88),
        height_m=2.05,
        closed=True,
    )


def _windows(rooms: tuple[PlannedRoom, ...], outline: Polygon, taken: Polygon, rng: Generator) -> tuple[Window, ...]:
    windows = []
    for room in rooms:
        for start, end in _outer_edges(room, outline):
            length = math.dist(start, end)
            if length < 1.6 or rng.random() < 0.35:
                continue
            small = room.kind is RoomKind.BATHROOM
            count = 1 if length < 5.5 or small else 2
            for k in range(count):
                share = length / count
                width = float(rng.uniform(0.5, 0.8) if small else rng.uniform(0.9, min(2.2, share - 0.7)))
                low, high = _opening(share, width, 0.3, rng)
                ends = (_along(start, end, k * share + low), _along(start, end, k * share + high))
                if taken.intersects(LineString(ends)):
                    continue
                sill, head = (1.4, 2.1) if small else (round(float(rng.uniform(0.3, 1.1)), 2), 2.15)
                windows.append(Window(start=ends[0], end=ends[1], sill_m=sill, head_m=head))
    return tuple(windows)


def _outer_edges(room: PlannedRoom, outline: Polygon) -> list[tuple[Segment, Segment]]:
    """Return where a room's boundary is the building's, moved out to the centre line of the outer wall."""
    centre = shapely.orient_polygons(outline.buffer(OUTER_THICKNESS_M / 2, join_style="mitre")).exterior
    edges = []
    for start, end in _shared(room.shape, outline):
        middle = shapely.Point((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        for x, y in ((0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1)):
            across = abs(x * (end[0] - start[0]) + y * (end[1] - start[1])) < 1e-6
            if across and centre.distance(shapely.Point(middle.x + x, middle.y + y)) < 1e-6:
                edges.append((_point(start[0] + x, start[1] + y), _point(end[0] + x, end[1] + y)))
    return edges


def _opening(length: float, width: float, margin: float, rng: Generator) -> Segment:
    """Return start and end of an opening along a segment: often near one end, as in real flats."""
    spare = length - width - 2 * margin
    share = float(rng.choice([0.0, rng.uniform(0, 1), 1.0]))
    low = margin + max(spare, 0.0) * share
    return (low, low + width)


def _along(start: Segment, end: Segment, way: float) -> Segment:
    share = way / math.dist(start, end)
    return _point(start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))


def _point(x: float, y: float) -> Segment:
    return (round(x, 3) + 0.0, round(y, 3) + 0.0)
