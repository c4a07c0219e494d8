"""Which goals the starting positions of a site have no way to, and what shuts it: the narrowest place of the way."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.free_space import RESOLUTION_M, FreeSpace
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Point, Site, StartingPosition
from vsnbench.protocol.survey.building import named_door, named_wall
from vsnbench.protocol.survey.finding import (
    Amount,
    Entry,
    Place,
    Severity,
    SiteFinding,
    area,
    listed,
    numbered,
    points,
    shown,
    stretch,
)
from vsnbench.protocol.walls import TOUCH_HEIGHT_M, wall_shapes, walls_of

_STEPS = 8
"""Halvings of the robot's radius until the narrowest place of a way is known: to under a millimetre."""
_REACH_M = 0.3
"""So far from a doorway's middle its two sides are looked for."""
_NEAR_M = 0.1

_BESIDE = np.ones((3, 3), np.bool_)
"""Cells that touch at a corner are beside each other."""

Grid = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class _Culprit:
    """What shuts a way."""

    code: str
    subject: str
    problem: str
    mend: str
    place: Place
    amount: Amount | None = None
    entries: tuple[Entry, ...] = ()


def way_findings(site: Site, space: FreeSpace, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    """Yield which starts cannot reach which goals, by what stands in their way; a narrow door also where all can."""
    lost: dict[_Culprit, dict[str, list[int]]] = {}
    search = _Search(site, space)
    for goal in GOAL_CATEGORIES:
        if not site.instances(goal):
            continue
        asked = [start for start in site.starts if goal not in start.not_for]
        if not asked:
            yield SiteFinding(
                Severity.WARNING,
                "goal-excluded",
                f"goal {goal}",
                "is excluded from every start by not_for",
                "leave one that uses it",
            )
        for start in asked:
            if not math.isfinite(space.geodesic_to_goal_m(start.pose, goal, rules)) and search.can_stand(start):
                culprit = search.culprit(start, goal, rules)
                lost.setdefault(culprit, {}).setdefault(goal, []).append(start.number)
    told: set[Entry] = set()
    for culprit, goals in lost.items():
        told |= set(culprit.entries)
        named = {number for numbers in goals.values() for number in numbers}
        index_of = {start.number: index for index, start in enumerate(site.starts)}
        starts = tuple(("starts", index_of[number]) for number in sorted(named))
        yield SiteFinding(
            Severity.ERROR,
            culprit.code,
            culprit.subject,
            f"{culprit.problem}: {_who(goals, len(site.starts))}",
            culprit.mend,
            culprit.place,
            culprit.amount,
            (*culprit.entries, *starts),
        )
    needed_m = 2 * space.robot_radius_m
    for index, door in enumerate(site.doors):
        if not door.closed and door.clear_width_m <= needed_m and ("doors", index) not in told:
            yield SiteFinding(
                Severity.WARNING,
                "door-too-narrow",
                named_door(door),
                f"is {door.clear_width_m:.2f} m clear, the robot needs {needed_m:.2f}",
                "it cannot pass; measure the clear opening between the jambs again",
                stretch(door.start, door.end),
                Amount(needed_m - door.clear_width_m),
                (("doors", index),),
            )


def _who(goals: dict[str, list[int]], count: int) -> str:
    """Say which starts cannot reach which goals, goals that the same starts miss together."""
    together: dict[tuple[int, ...], list[str]] = {}
    for goal, numbers in goals.items():
        together.setdefault(tuple(sorted(numbers)), []).append(goal)
    parts = []
    for starts, missed in together.items():
        who = numbered("start", list(starts)) if len(starts) < count or count == 1 else "no start"
        cannot = "can reach" if who == "no start" else "cannot reach"
        parts.append(f"{who} {cannot} a {listed(missed, 'or')}")
    return "; ".join(parts)


class _Search:
    """Looks for what shuts the way from a start to a goal."""

    def __init__(self, site: Site, space: FreeSpace) -> None:
        self._site, self._space = site, space
        self._known: dict[tuple[int, str], _Culprit] = {}
        self._labels: dict[float, Grid] = {}
        self._goals: dict[str, npt.NDArray[np.bool_]] = {}

    def can_stand(self, start: StartingPosition) -> bool:
        """Whether the start itself is sound; what is wrong with it is told elsewhere."""
        return self._space.clearance_at_m(*start.position) >= self._space.robot_radius_m

    def culprit(self, start: StartingPosition, goal: str, rules: ProtocolParameters) -> _Culprit:
        """Return what shuts the way; the same for all starts that stand in one part of the free space."""
        home = self._label_near(self._connected(self._space.robot_radius_m), start.position)
        if home == 0:
            return self._nowhere(start)
        if (home, goal) not in self._known:
            if goal not in self._goals:
                self._goals[goal] = self._space.success_level_m(goal, rules) <= 0
            self._known[home, goal] = self._narrowest(start, goal) or self._shut_in(start, goal)
        return self._known[home, goal]

    def _connected(self, clearance_m: float) -> Grid:
        """Return (rows, columns): which part of the floor a cell is in for a robot of a radius; 0 for none."""
        from scipy import ndimage

        if clearance_m not in self._labels:
            labels, _ = ndimage.label(self._space.clearance_m >= clearance_m, _BESIDE)
            self._labels[clearance_m] = np.asarray(labels, np.int32)
        return self._labels[clearance_m]

    def _label_near(self, labels: Grid, at: Point) -> int:
        row, column = self._space.cell_of(*at)
        near = labels[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
        return int(near.max(initial=0))

    def _reaches(self, clearance_m: float, start: StartingPosition, goal: str) -> bool:
        labels = self._connected(clearance_m)
        home = self._label_near(labels, start.position)
        return home > 0 and bool((self._goals[goal] & (labels == home)).any())

    def _narrowest(self, start: StartingPosition, goal: str) -> _Culprit | None:
        """Return the narrowest place of the widest way; None where there is no way at all."""
        low, high = 2e-3, self._space.robot_radius_m
        if not self._reaches(low, start, goal):
            return None
        for _ in range(_STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if self._reaches(middle, start, goal) else (low, middle)
        wide, narrow = self._connected(high), self._connected(low)
        home, reached = self._label_near(wide, start.position), self._label_near(narrow, start.position)
        return self._between((narrow == reached) & (wide == 0), wide, home, low)

    def _between(self, pinch: npt.NDArray[np.bool_], wide: Grid, home: int, low_m: float) -> _Culprit:
        """Name what is on both sides of the cells that join the start's part to another."""
        from scipy import ndimage

        blobs, count = ndimage.label(pinch, _BESIDE)
        chosen = None
        for blob in range(1, count + 1):
            around = set(np.unique(wide[ndimage.binary_dilation(blobs == blob, _BESIDE)]).tolist()) - {0}
            if home in around and len(around) > 1:
                chosen = blobs == blob
                break
            if home in around and chosen is None:
                chosen = blobs == blob
        cells = np.argwhere(pinch if chosen is None else chosen)
        clearance = self._space.clearance_m[cells[:, 0], cells[:, 1]]
        row, column = cells[int(np.argmin(np.abs(clearance - low_m)))]
        at = (float(self._space.x_m[row, column]), float(self._space.y_m[row, column]))
        return self._at(at)

    def _at(self, at: Point) -> _Culprit:
        site, here, needed_m = self._site, shapely.Point(at), 2 * self._space.robot_radius_m
        for index, door in enumerate(site.doors):
            half_m = max((wall.thickness_m / 2 for wall in walls_of(site, door.start, door.end)), default=0.05)
            clear_m = door.clear_width_m
            near = not door.closed and door.centre_line.distance(here) < half_m + _NEAR_M
            if near and clear_m < needed_m + 2 * RESOLUTION_M:
                return _Culprit(
                    "door-too-narrow",
                    named_door(door),
                    f"is {clear_m:.2f} m clear, the robot needs {max(needed_m, clear_m + 0.01):.2f}",
                    "measure the clear opening between the jambs again, use a narrower robot (--robot), or exclude "
                    "the goal there with not_for",
                    stretch(door.start, door.end),
                    Amount(needed_m - clear_m),
                    (("doors", index),),
                )
        sides = sorted((float(shape.distance(here)), number) for number, (shape, _, _) in enumerate(self._solids()))
        (first_m, first), (_, second) = sides[0], self._opposite(sides, at)
        (one, name, entry), (other, other_name, other_entry) = self._solids()[first], self._solids()[second]
        gap_m = float(one.distance(other)) or 2 * first_m
        return _Culprit(
            "passage-too-narrow",
            f"the passage at {shown(at)} between {name} and {other_name}",
            f"is {gap_m:.2f} m wide, the robot needs {needed_m:.2f}",
            f"move one by {max(needed_m - gap_m + 2 * RESOLUTION_M, 0.01):.2f} m, or measure both again",
            stretch(*_ends(shapely.shortest_line(one, other), at)),
            Amount(needed_m - gap_m),
            (entry, other_entry),
        )

    def _opposite(self, sides: list[tuple[float, int]], at: Point) -> tuple[float, int]:
        """Return the nearest solid on the other side of a place than the nearest."""
        solids, here = self._solids(), shapely.Point(at)

        def towards(number: int) -> npt.NDArray[np.float64]:
            _, (x_m, y_m) = shapely.shortest_line(here, solids[number][0]).coords
            return np.array([x_m - at[0], y_m - at[1]])

        first = towards(sides[0][1])
        return next((side for side in sides[1:] if float(towards(side[1]) @ first) < 0), sides[1])

    def _solids(self) -> list[tuple[BaseGeometry, str, Entry]]:
        site = self._site
        walls: list[tuple[BaseGeometry, str, Entry]] = [
            (shape, named_wall(site, index), ("walls", index)) for index, shape in enumerate(wall_shapes(site))
        ]
        return walls + [
            (thing.shape, thing.id, ("objects", index))
            for index, thing in enumerate(site.objects)
            if thing.solid and thing.elevation_m < TOUCH_HEIGHT_M
        ]

    def _shut_in(self, start: StartingPosition, goal: str) -> _Culprit:
        """Name the closed door, or the thing, that shuts a way where no robot however small passes; else the room."""
        labels = self._connected(2e-3)
        home = self._label_near(labels, start.position)
        there = set(np.unique(labels[self._goals[goal]]).tolist()) - {0, home}
        for index, door in enumerate(self._site.doors):
            if door.closed and _joins(self._around(labels, door.centre_line.buffer(_REACH_M)), home, there):
                return _Culprit(
                    "door-closed",
                    named_door(door),
                    "is closed",
                    "remove closed: true if it stands open during trials, or exclude the goal there with not_for",
                    stretch(door.start, door.end),
                    entries=(("doors", index),),
                )
        for index, thing in enumerate(self._site.objects):
            if thing.solid and _joins(self._around(labels, thing.shape.buffer(2 * RESOLUTION_M)), home, there):
                return _Culprit(
                    "way-blocked",
                    thing.id,
                    f"at {shown(thing.position)} shuts the way",
                    f"move it; the robot needs {2 * self._space.robot_radius_m:.2f} m beside it",
                    area(*((float(x), float(y)) for x, y in shapely.get_coordinates(thing.shape.exterior)[:-1])),
                    entries=(("objects", index),),
                )
        return self._no_door(start, goal)

    def _no_door(self, start: StartingPosition, goal: str) -> _Culprit:
        """Name the room that no door leads into: the start's, or the goal's."""
        site = self._site
        rooms = [
            (index, room, [door for door in site.doors if room.shape.distance(door.centre_line) < _NEAR_M])
            for index, room in enumerate(site.rooms)
        ]
        places = [start.position, *(thing.position for thing in site.instances(goal))]
        concerned = [each for at in places for each in rooms if each[1].shape.covers(shapely.Point(at))]
        for index, room, doors in concerned:
            if not doors and len(site.rooms) > 1:
                return _Culprit(
                    "room-without-door",
                    f"room `{room.name}`",
                    "has no door",
                    "add the door that leads into it to doors: the two ends of its clear opening on the wall's "
                    "centre line",
                    area(*room.polygon),
                    entries=(("rooms", index),),
                )
        instances = [thing.id for thing in site.instances(goal)]
        return _Culprit(
            "goal-shut-in",
            instances[0] if len(instances) == 1 else f"every {goal} ({', '.join(instances)})",
            "is shut in",
            "look for a door that is missing, or furniture in the way",
            points(*(thing.position for thing in site.instances(goal))),
        )

    def _nowhere(self, start: StartingPosition) -> _Culprit:
        return _Culprit(
            "start-hemmed-in",
            f"start {start.number}",
            f"at {shown(start.position)} leaves the robot no room to move",
            "move it away from what stands around it",
            points(start.position),
        )

    def _around(self, labels: Grid, shape: BaseGeometry) -> set[int]:
        """Return the parts of the floor that a shape reaches."""
        space = self._space
        x_min, y_min, x_max, y_max = shape.bounds
        low, left = space.cell_of(x_min, y_min)
        high, right = space.cell_of(x_max, y_max)
        window = (slice(low, high + 1), slice(left, right + 1))
        inside = shapely.contains_xy(shape, space.x_m[window], space.y_m[window])
        return set(np.unique(labels[window][inside]).tolist()) - {0}


def _joins(parts: set[int], home: int, there: set[int]) -> bool:
    return home in parts and bool(parts & there)


def _ends(line: BaseGeometry, at: Point) -> tuple[Point, Point]:
    (x0, y0), (x1, y1) = shapely.get_coordinates(line)
    if math.dist((x0, y0), (x1, y1)) < 1e-6:
        return at, at
    return (float(x0), float(y0)), (float(x1), float(y1))
