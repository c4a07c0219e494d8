"""Places arrangements of furniture in a building: against walls, in corners or free-standing, without collisions."""

import itertools
import math
from collections import Counter
from dataclasses import dataclass, field, replace

import shapely
from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Polygon, box

from vsnbench.simulator.generated_sites.layout import PlannedRoom
from vsnbench.simulator.generated_sites.shell import Shell
from vsnbench.sites.geometry.walls import TOUCH_HEIGHT_M, top_m
from vsnbench.sites.site import SiteObject
from vsnbench.values.pose import Pose

_WALL_GAP_M = 0.02
"""Depth of skirting boards."""
_DOOR_DEPTH_M = 1.0
_APART_M = 0.03
_BESIDE_DOOR_M = 0.2
"""Minimum distance of pictures from a doorway and its casing."""


@dataclass(frozen=True, slots=True)
class Piece:
    """One object in the frame of its arrangement: x away from the wall, y to the left."""

    category: str
    size_m: tuple[float, float, float]
    x_m: float = 0.0
    y_m: float = 0.0
    turn_deg: float = 0.0
    model: str | None = None
    color: str | None = None
    elevation_m: float = 0.0
    solid: bool = True


@dataclass(frozen=True, slots=True)
class Strip:
    """A rectangle of floor in an arrangement's frame that must stay free."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Arrangement:
    """A group of pieces, and the free floor in front of them."""

    pieces: tuple[Piece, ...]
    free: tuple[Strip, ...] = ()

    @property
    def half_width_m(self) -> float:
        """Extent of the pieces to both sides of the arrangement's origin, metres."""
        return max(abs(piece.y_m) + piece.size_m[1] / 2 for piece in self.pieces)


@dataclass(slots=True)
class Placer:
    """Tracks placed objects and floor that must stay free."""

    rooms: tuple[PlannedRoom, ...]
    shell: Shell
    rng: Generator
    objects: list[SiteObject] = field(default_factory=list)
    _kept_free: list[Polygon] = field(default_factory=list)
    _counts: Counter[str] = field(default_factory=Counter)
    _walls: shapely.Geometry = field(default_factory=Polygon)

    def __post_init__(self) -> None:
        self._walls = shapely.union_all([wall.shape for wall in self.shell.walls])
        for door in self.shell.doors:
            depth = _DOOR_DEPTH_M if not door.closed else 0.9
            self._kept_free.append(door.centre_line.buffer(depth, cap_style="flat"))
            self._kept_free.append(door.centre_line.buffer(0.25))

    def interior(self, room: PlannedRoom) -> Polygon:
        """Return a room's floor between the faces of its walls."""
        parts = [part for part in shapely.get_parts(room.shape.difference(self._walls)) if part.area > 0.5]
        largest = max(parts, key=lambda part: float(part.area))
        return Polygon(shapely.orient_polygons(largest.simplify(0.001)))

    def against_wall(self, room: PlannedRoom, arrangement: Arrangement, tries: int = 30, corner: float = 0.4) -> bool:
        """Place an arrangement with its back to a wall; `corner` is the probability of a place in a corner."""
        floor = self.interior(room)
        need = arrangement.half_width_m + _WALL_GAP_M
        edges = [(a, b) for a, b in itertools.pairwise(floor.exterior.coords) if math.dist(a, b) > 2 * need]
        if not edges:
            return False
        lengths = [math.dist(a, b) for a, b in edges]
        for _ in range(tries):
            k = int(self.rng.choice(len(edges), p=[length / sum(lengths) for length in lengths]))
            way = float(self.rng.uniform(need, lengths[k] - need))
            if self.rng.random() < corner:
                way = need if self.rng.random() < 0.5 else lengths[k] - need
            if self._stand(_on_wall(*edges[k], way), arrangement, floor):
                return True
        return False

    def in_corner(self, room: PlannedRoom, piece: Piece) -> bool:
        """Place a piece in a corner of a room, or otherwise anywhere along its walls."""
        floor = self.interior(room)
        ring = list(floor.exterior.coords)[:-1]
        reach = max(piece.size_m[:2]) / 2 + 0.05
        for k in self.rng.permutation(len(ring)):
            before, corner, after = ring[k - 1], ring[k], ring[(k + 1) % len(ring)]
            u, v = _towards(corner, before), _towards(corner, after)
            if u[0] * v[1] - u[1] * v[0] > 0:  # a corner that projects into the room
                continue
            place = Pose(corner[0] + reach * (u[0] + v[0]), corner[1] + reach * (u[1] + v[1]))
            if self._stand(place, Arrangement((piece,)), floor):
                return True
        return self.against_wall(room, Arrangement((replace(piece, x_m=piece.size_m[0] / 2 + 0.03),)))

    def free_standing(self, room: PlannedRoom, arrangement: Arrangement) -> bool:
        """Place an arrangement anywhere in a room, parallel to its walls."""
        floor = self.interior(room)
        x0, y0, x1, y1 = floor.bounds
        for _ in range(60):
            heading = math.radians(90.0 * int(self.rng.integers(4)))
            place = Pose(float(self.rng.uniform(x0, x1)), float(self.rng.uniform(y0, y1)), heading)
            if floor.contains(shapely.Point(place.position)) and self._stand(place, arrangement, floor):
                return True
        return False

    def on_wall(self, room: PlannedRoom, piece: Piece) -> bool:
        """Hang a piece on a wall without tall objects."""
        return self.against_wall(
            room, Arrangement((replace(piece, x_m=piece.size_m[0] / 2 - 0.01),)), tries=12, corner=0.0
        )

    def _stand(self, place: Pose, arrangement: Arrangement, floor: Polygon) -> bool:
        things = [self._thing(place, piece) for piece in arrangement.pieces]
        free = [_strip(place, strip) for strip in arrangement.free]
        if not all(self._fits(thing, floor) for thing in things) or not self._leaves_free(free):
            return False
        for thing in things:
            self._counts[thing.category] += 1
            named = f"{thing.category.replace('_', '-')}-{self._counts[thing.category]}"
            self.objects.append(thing.model_copy(update={"id": named}))
        self._kept_free += free
        return True

    def _thing(self, place: Pose, piece: Piece) -> SiteObject:
        at = place.compose(Pose(piece.x_m, piece.y_m))
        return SiteObject(
            id="new",
            category=piece.category,
            position=(round(at.x_m, 3), round(at.y_m, 3)),
            heading_deg=round(math.remainder(place.heading_deg + piece.turn_deg, 360.0), 1) + 0.0,
            size_m=piece.size_m,
            elevation_m=round(piece.elevation_m, 3),
            model=piece.model,
            color=piece.color,
            solid=piece.solid,
        )

    def _fits(self, thing: SiteObject, floor: Polygon) -> bool:
        if not floor.buffer(1e-3).covers(thing.shape):
            return False
        for window in self.shell.windows:
            covers = top_m(thing) > window.sill_m + 0.1 and thing.elevation_m < window.head_m
            if covers and thing.shape.distance(window.centre_line) < 0.3:
                return False
        if thing.elevation_m > TOUCH_HEIGHT_M:
            if any(thing.shape.distance(door.centre_line) < _BESIDE_DOOR_M for door in self.shell.doors):
                return False
            return not any(other.shape.intersects(thing.shape) for other in self.objects if top_m(other) > 1.1)
        if not thing.solid:
            return not any(other.shape.intersects(thing.shape) for other in self.objects if not other.solid)
        if any(kept.intersection(thing.shape).area > 1e-3 for kept in self._kept_free):
            return False
        return not any(
            other.shape.distance(thing.shape) < _APART_M
            for other in self.objects
            if other.solid and (other.elevation_m < TOUCH_HEIGHT_M or top_m(thing) > other.elevation_m)
        )

    def _leaves_free(self, strips: list[Polygon]) -> bool:
        solid = [thing.shape for thing in self.objects if thing.solid and thing.elevation_m < TOUCH_HEIGHT_M]
        return not any(strip.intersection(shape).area > 1e-3 for strip in strips for shape in solid)


def _on_wall(start: tuple[float, ...], end: tuple[float, ...], way: float) -> Pose:
    """Return the pose on a wall's face that looks into the room; rooms are to the left of their edges."""
    u = _towards(start, end)
    x, y = start[0] + way * u[0], start[1] + way * u[1]
    return Pose(x - _WALL_GAP_M * u[1], y + _WALL_GAP_M * u[0], math.atan2(u[0], -u[1]))


def _towards(start: tuple[float, ...], end: tuple[float, ...]) -> tuple[float, float]:
    length = math.dist(start, end)
    return ((end[0] - start[0]) / length, (end[1] - start[1]) / length)


def _strip(place: Pose, strip: Strip) -> Polygon:
    upright = box(strip.x_m[0], strip.y_m[0], strip.x_m[1], strip.y_m[1])
    return affinity.translate(affinity.rotate(upright, place.heading_deg, origin=(0, 0)), place.x_m, place.y_m)
