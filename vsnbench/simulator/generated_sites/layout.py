"""Layouts of flats: an outline of 50 to 100 m2 divided into rooms around a hub with doors to all of them."""

from dataclasses import dataclass
from enum import StrEnum

import shapely
from numpy.random import Generator
from shapely import affinity, union_all
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

_STEP_M = 0.05


class RoomKind(StrEnum):
    """Use of a room."""

    LIVING = "living room"
    CORRIDOR = "corridor"
    BEDROOM = "bedroom"
    SECOND_BEDROOM = "second bedroom"
    BATHROOM = "bathroom"
    KITCHEN = "kitchen"
    STUDY = "study"


@dataclass(frozen=True, slots=True)
class PlannedRoom:
    """A room's use and outline; outlines meet at the centre lines of walls."""

    kind: RoomKind
    shape: Polygon
    hub: bool = False
    """Whether other rooms have doors to it."""


def draw_layout(rng: Generator) -> tuple[PlannedRoom, ...]:
    """Return the rooms of a flat, hubs first; some draws are not valid."""
    rooms = _KINDS[rng.integers(len(_KINDS))](rng)
    quarter_turns, mirrored = int(rng.integers(4)), bool(rng.integers(2))
    return tuple(
        PlannedRoom(room.kind, turned, room.hub)
        for room, turned in zip(rooms, _turned([room.shape for room in rooms], quarter_turns, mirrored), strict=True)
    )


def _between(rng: Generator, low: float, high: float) -> float:
    return round(round(float(rng.uniform(low, max(low, high))) / _STEP_M) * _STEP_M, 2)


def _hub_and_strip(rng: Generator) -> list[PlannedRoom]:
    """Private rooms in a row on one side; the kitchen may be cut out of a corner of the rest."""
    height = _between(rng, 6.2, 8.6)
    strip = _between(rng, 2.7, 3.6)
    width = _between(rng, max(54 / height, strip + 4.2), min(94 / height, strip + 7.5))
    hub = width - strip
    kinds = [RoomKind.BATHROOM, RoomKind.BEDROOM]
    cuts = [0.0, _between(rng, 2.3, 2.9), height]
    if height > 7.7:
        kinds.append(rng.choice([RoomKind.STUDY, RoomKind.SECOND_BEDROOM]))
        cuts.insert(2, _between(rng, cuts[1] + 2.9, height - 2.5))
    rooms = [
        PlannedRoom(RoomKind(kind), box(hub, low, width, high))
        for kind, low, high in zip(kinds, cuts, cuts[1:], strict=False)
    ]
    if hub > 5.0 and rng.random() < 0.5:
        rooms.append(_corner_kitchen(rng, height))
    return _with_hub(box(0, 0, width, height), rooms)


def _corner_kitchen(rng: Generator, height: float) -> PlannedRoom:
    wide, deep = _between(rng, 2.6, 3.4), _between(rng, 2.4, 3.0)
    return PlannedRoom(RoomKind.KITCHEN, box(0, height - deep, wide, height))


def _hub_with_corners(rng: Generator) -> list[PlannedRoom]:
    """Rooms in the corners of one large space; a corner of the outline may be missing."""
    height = _between(rng, 6.8, 9.0)
    width = _between(rng, max(56 / height, 7.2), min(96 / height, 12.0))
    bedroom = box(width - _between(rng, 3.2, 4.2), height - _between(rng, 3.0, 3.8), width, height)
    bathroom = box(width - _between(rng, 2.3, 3.2), 0, width, _between(rng, 2.3, 2.8))
    rooms = [PlannedRoom(RoomKind.BEDROOM, bedroom), PlannedRoom(RoomKind.BATHROOM, bathroom)]
    outline: BaseGeometry = box(0, 0, width, height)
    rest = width - (bedroom.bounds[2] - bedroom.bounds[0])
    use = rng.random()
    if use < 0.3 and rest > 4.6:
        rooms.append(_corner_kitchen(rng, height))
    elif use < 0.55 and rest > 4.9:
        kind = RoomKind(rng.choice([RoomKind.STUDY, RoomKind.SECOND_BEDROOM]))
        rooms.append(PlannedRoom(kind, box(0, 0, _between(rng, 2.6, 3.3), _between(rng, 2.8, 3.3))))
    elif use < 0.8 and rest > 5.0:
        outline = outline.difference(box(0, 0, _between(rng, 1.4, 2.4), _between(rng, 1.2, 2.2)))
    return _with_hub(outline, rooms)


def _corridor(rng: Generator) -> list[PlannedRoom]:
    """A living room at one end of a corridor with rooms on both sides."""
    north, south, corridor = _between(rng, 2.7, 3.4), _between(rng, 2.5, 3.3), _between(rng, 1.3, 1.6)
    height = round(north + south + corridor, 2)
    living = _between(rng, 3.9, 5.2)
    width = _between(rng, max(56 / height, living + 4.4), min(96 / height, living + 7.0))
    top, bottom = round(south + corridor, 2), south
    upper = _between(rng, living + 2.9, width - 2.3)
    lower = _between(rng, living + 2.6, width - 2.4)
    second = RoomKind(rng.choice([RoomKind.STUDY, RoomKind.SECOND_BEDROOM]))
    rooms = [
        PlannedRoom(RoomKind.BEDROOM, box(living, top, upper, height)),
        PlannedRoom(RoomKind.BATHROOM, box(upper, top, width, height)),
        PlannedRoom(RoomKind.KITCHEN, box(living, 0, lower, bottom)),
        PlannedRoom(second, box(lower, 0, width, bottom)),
    ]
    hubs = [
        PlannedRoom(RoomKind.LIVING, box(0, 0, living, height), hub=True),
        PlannedRoom(RoomKind.CORRIDOR, box(living, bottom, width, top), hub=True),
    ]
    return hubs + rooms


def _with_hub(outline: BaseGeometry, rooms: list[PlannedRoom]) -> list[PlannedRoom]:
    rest = outline.difference(union_all([room.shape for room in rooms]))
    return [PlannedRoom(RoomKind.LIVING, Polygon(shapely.get_exterior_ring(rest.simplify(0))), hub=True), *rooms]


def _turned(shapes: list[Polygon], quarter_turns: int, mirrored: bool) -> list[Polygon]:
    """Return rotated and mirrored outlines; their common lower left corner becomes the origin."""
    if mirrored:
        shapes = [affinity.scale(shape, -1, 1, origin=(0, 0)) for shape in shapes]
    shapes = [affinity.rotate(shape, 90 * quarter_turns, origin=(0, 0)) for shape in shapes]
    x = min(shape.bounds[0] for shape in shapes)
    y = min(shape.bounds[1] for shape in shapes)
    moved = [affinity.translate(shape, -x, -y) for shape in shapes]
    return [Polygon([(round(px, 2) + 0.0, round(py, 2) + 0.0) for px, py in shape.exterior.coords]) for shape in moved]


_KINDS = (_hub_and_strip, _hub_with_corners, _corridor)
