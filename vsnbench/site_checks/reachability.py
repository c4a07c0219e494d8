"""Checks that each starting position has a path to each goal; finds what blocks a missing path."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.free_space import RESOLUTION_M, FreeSpace
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.site_checks.finding import (
    Entry,
    Severity,
    SiteFinding,
    area,
    goal_entries,
    join_names,
    number_ranges,
    outline,
    point_text,
    points,
    stretch,
)
from vsnbench.site_checks.walls import door_name, wall_name
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.fields import Point
from vsnbench.sites.geometry.walls import TOUCH_HEIGHT_M, wall_shapes, walls_of
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.sites.targets import Target, targets_of

_STEPS = 8
"""Bisection steps of the clearance at the narrowest place: to under a millimetre."""
_REACH_M = 0.3
"""Distance from a door's centre line within which its two sides are searched."""
_NEAR_M = 0.1

_NEIGHBOURS = np.ones((3, 3), np.bool_)
"""Cells that touch at a corner are connected."""

Grid = npt.NDArray[np.int32]
NamedSolid = tuple[BaseGeometry, str, Entry]


def reachability_findings(site: Site, space: FreeSpace, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    """Yield an error for each blockage between starts and goals, and a warning for each other narrow door."""
    lost: dict[SiteFinding, dict[str, list[int]]] = {}
    search = _Search(site, space)
    for goal in checked_goals(site):
        starts_of_goal = [start for start in site.starts if (goal, start.number) not in site.excluded]
        if not starts_of_goal:
            yield SiteFinding(
                Severity.WARNING,
                "goal-excluded",
                f"goal {goal}",
                "is excluded from every start by not_for",
                "remove it from the not_for of at least one start",
                entries=goal_entries(site, [goal]),
            )
        without_path = space.without_path([start.pose for start in starts_of_goal], goal, rules)
        for start in starts_of_goal:
            if start.pose not in without_path:
                continue
            if space.clearance_at_m(*start.position) >= space.robot_radius_m:  # else `start_findings` reports it
                blockage = search.blockage(start, goal, rules)
                lost.setdefault(blockage, {}).setdefault(goal, []).append(start.number)
    reported: set[Entry] = set()
    for blockage, goals in lost.items():
        reported |= set(blockage.entries)
        named = {number for numbers in goals.values() for number in numbers}
        index_of = {start.number: index for index, start in enumerate(site.starts)}
        starts = tuple(("starts", index_of[number]) for number in sorted(named))
        yield replace(
            blockage,
            problem=f"{blockage.problem}: {_unreachable_text(goals, len(site.starts))}",
            entries=(*blockage.entries, *starts, *goal_entries(site, goals)),
        )
    needed_m = 2 * space.robot_radius_m
    for index, door in enumerate(site.doors):
        if not door.closed and door.length_m <= needed_m and ("doors", index) not in reported:
            yield SiteFinding(
                Severity.WARNING,
                "door-too-narrow",
                door_name(door),
                f"is {door.length_m:.2f} m clear, the robot needs {needed_m:.2f}",
                "measure the clear opening between the jambs again",
                stretch(door.start, door.end),
                needed_m - door.length_m,
                (("doors", index),),
            )


def checked_goals(site: Site) -> list[str]:
    """Return the goals of the paper that the site has, and those of the site file: of a sequence, each of its goals."""
    of_paper = (goal for goal in GOAL_CATEGORIES if site.instances(goal))
    return list(dict.fromkeys((*of_paper, *(leg for goal in site.goals for leg in goal.legs))))


def _unreachable_text(goals: dict[str, list[int]], count: int) -> str:
    """Return text about which starts cannot reach which goals; goals with the same starts are grouped."""
    together: dict[tuple[int, ...], list[str]] = {}
    for goal, numbers in goals.items():
        together.setdefault(tuple(sorted(numbers)), []).append(goal)
    parts = []
    for starts, missed in together.items():
        who = number_ranges("start", list(starts)) if len(starts) < count or count == 1 else "no start"
        cannot = "can reach" if who == "no start" else "cannot reach"
        parts.append(f"{who} {cannot} a {join_names(missed, 'or')}")
    return "; ".join(parts)


class _Search:
    """Finds what blocks the path from a start to a goal."""

    def __init__(self, site: Site, space: FreeSpace) -> None:
        self._site, self._space = site, space
        self._known: dict[tuple[int, str], SiteFinding] = {}
        self._labels: dict[float, Grid] = {}
        self._goals: dict[str, npt.NDArray[np.bool_]] = {}

    def blockage(self, start: StartingPosition, goal: str, rules: ProtocolParameters) -> SiteFinding:
        """Return what blocks the path; starts in one connected part of the free space share the result."""
        home = self._label_near(self._connected(self._space.robot_radius_m), start.position)
        if home == 0:
            return SiteFinding(
                Severity.ERROR,
                "start-hemmed-in",
                f"start {start.number}",
                f"at {point_text(start.position)} leaves the robot no room to move",
                "move it away from the objects around it",
                points(start.position),
            )
        if (home, goal) not in self._known:
            if goal not in self._goals:
                self._goals[goal] = self._space.success_level_m(goal, rules) <= 0
            self._known[home, goal] = self._narrowest(start, goal) or self._shut_in(start, goal)
        return self._known[home, goal]

    def _connected(self, clearance_m: float) -> Grid:
        """Return (rows, columns) labels of the connected parts of the floor at a clearance; 0 for none."""
        from scipy import ndimage

        if clearance_m not in self._labels:
            labels, _ = ndimage.label(self._space.clearance_m >= clearance_m, _NEIGHBOURS)
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

    def _narrowest(self, start: StartingPosition, goal: str) -> SiteFinding | None:
        """Return the narrowest place of the widest path; None if there is no path at all."""
        low, high = 2e-3, self._space.robot_radius_m
        if not self._reaches(low, start, goal):
            return None
        for _ in range(_STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if self._reaches(middle, start, goal) else (low, middle)
        wide, narrow = self._connected(high), self._connected(low)
        home, reached = self._label_near(wide, start.position), self._label_near(narrow, start.position)
        return self._between((narrow == reached) & (wide == 0), wide, home, low)

    def _between(self, pinch: npt.NDArray[np.bool_], wide: Grid, home: int, low_m: float) -> SiteFinding:
        """Return the blockage at the cells that connect the start's part to another part."""
        from scipy import ndimage

        blobs, count = ndimage.label(pinch, _NEIGHBOURS)
        chosen = None
        for blob in range(1, count + 1):
            around = set(np.unique(wide[ndimage.binary_dilation(blobs == blob, _NEIGHBOURS)]).tolist()) - {0}
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

    def _at(self, at: Point) -> SiteFinding:
        site, here, needed_m = self._site, shapely.Point(at), 2 * self._space.robot_radius_m
        for index, door in enumerate(site.doors):
            half_m = max((wall.thickness_m / 2 for wall in walls_of(site, door.start, door.end)), default=0.05)
            clear_m = door.length_m
            near = not door.closed and door.centre_line.distance(here) < half_m + _NEAR_M
            if near and clear_m < needed_m + 2 * RESOLUTION_M:
                return SiteFinding(
                    Severity.ERROR,
                    "door-too-narrow",
                    door_name(door),
                    f"is {clear_m:.2f} m clear, the robot needs {max(needed_m, clear_m + 0.01):.2f}",
                    "measure the clear opening between the jambs again, use a narrower robot (--robot), or exclude "
                    "the goal there with not_for",
                    stretch(door.start, door.end),
                    needed_m - clear_m,
                    (("doors", index),),
                )
        solids = named_solids(site)
        sides = sorted((float(shape.distance(here)), number) for number, (shape, _, _) in enumerate(solids))
        nearest_first = [solids[number] for _, number in sides]
        (solid, name, entry), (other, other_name, other_entry) = nearest_first[0], _opposite(nearest_first, at)
        gap_m = float(solid.distance(other)) or 2 * sides[0][0]
        return SiteFinding(
            Severity.ERROR,
            "passage-too-narrow",
            f"the passage at {point_text(at)} between {name} and {other_name}",
            f"is {gap_m:.2f} m wide, the robot needs {needed_m:.2f}",
            f"move one of them by {max(needed_m - gap_m + 2 * RESOLUTION_M, 0.01):.2f} m, or measure both again",
            stretch(*_ends(shapely.shortest_line(solid, other), at)),
            needed_m - gap_m,
            (entry, other_entry),
        )

    def _shut_in(self, start: StartingPosition, goal: str) -> SiteFinding:
        """Return the closed door or object that blocks robots of any size; otherwise the room without a door."""
        labels = self._connected(2e-3)
        home = self._label_near(labels, start.position)
        there = set(np.unique(labels[self._goals[goal]]).tolist()) - {0, home}
        for index, door in enumerate(self._site.doors):
            if door.closed and _joins(self._around(labels, door.centre_line.buffer(_REACH_M)), home, there):
                return SiteFinding(
                    Severity.ERROR,
                    "door-closed",
                    door_name(door),
                    "is closed",
                    "remove closed: true if it is open during trials, or exclude the goal there with not_for",
                    stretch(door.start, door.end),
                    entries=(("doors", index),),
                )
        for index, thing in enumerate(self._site.objects):
            if thing.solid and _joins(self._around(labels, thing.shape.buffer(2 * RESOLUTION_M)), home, there):
                return SiteFinding(
                    Severity.ERROR,
                    "way-blocked",
                    thing.id,
                    f"at {point_text(thing.position)} blocks the path",
                    f"move it; the robot needs {2 * self._space.robot_radius_m:.2f} m next to it",
                    outline(thing.shape),
                    entries=(("objects", index),),
                )
        return self._no_door(start, goal)

    def _no_door(self, start: StartingPosition, goal: str) -> SiteFinding:
        """Return the room of the start or of the goal that has no door."""
        site = self._site
        rooms = [
            (index, room, [door for door in site.doors if room.shape.distance(door.centre_line) < _NEAR_M])
            for index, room in enumerate(site.rooms)
        ]
        targets = targets_of(site, goal)
        target_points = [_target_point(target) for target in targets]
        places = [shapely.Point(at) for at in (start.position, *target_points)]
        concerned = [room for place in places for room in rooms if room[1].shape.covers(place)]
        for index, room, doors in concerned:
            if not doors and len(site.rooms) > 1:
                return SiteFinding(
                    Severity.ERROR,
                    "room-without-door",
                    f"room `{room.name}`",
                    "has no door",
                    "add its door to doors: the two ends of the clear opening on the wall's centre line",
                    area(*room.polygon),
                    entries=(("rooms", index),),
                )
        instances = [target.id for target in targets]
        return SiteFinding(
            Severity.ERROR,
            "goal-shut-in",
            instances[0] if len(instances) == 1 else f"every {goal} ({', '.join(instances)})",
            "is enclosed",
            "look for a missing door, or for furniture in the way",
            points(*target_points),
        )

    def _around(self, labels: Grid, shape: BaseGeometry) -> set[int]:
        """Return the labels of the parts of the floor inside a shape."""
        space = self._space
        x_min, y_min, x_max, y_max = shape.bounds
        low, left = space.cell_of(x_min, y_min)
        high, right = space.cell_of(x_max, y_max)
        window = (slice(low, high + 1), slice(left, right + 1))
        inside = shapely.contains_xy(shape, space.x_m[window], space.y_m[window])
        return set(np.unique(labels[window][inside]).tolist()) - {0}


def named_solids(site: Site) -> list[NamedSolid]:
    """Return the walls and objects that a robot can touch: footprint, name in findings and entry."""
    walls: list[NamedSolid] = [
        (shape, wall_name(site, index), ("walls", index)) for index, shape in enumerate(wall_shapes(site))
    ]
    return walls + [
        (thing.shape, thing.id, ("objects", index))
        for index, thing in enumerate(site.objects)
        if thing.solid and thing.elevation_m < TOUCH_HEIGHT_M
    ]


def _opposite(nearest_first: list[NamedSolid], at: Point) -> NamedSolid:
    """Return the nearest solid on the side of a place that is opposite to the nearest solid."""
    here = shapely.Point(at)

    def towards(solid: NamedSolid) -> npt.NDArray[np.float64]:
        _, (x_m, y_m) = shapely.shortest_line(here, solid[0]).coords
        return np.array([x_m - at[0], y_m - at[1]])

    first = towards(nearest_first[0])
    return next((solid for solid in nearest_first[1:] if float(towards(solid) @ first) < 0), nearest_first[1])


def _target_point(target: Target) -> Point:
    """Return the position of an object, or the centre of a region."""
    centre = target.shape.centroid
    return target.thing.position if target.thing is not None else (float(centre.x), float(centre.y))


def _joins(parts: set[int], home: int, there: set[int]) -> bool:
    return home in parts and bool(parts & there)


def _ends(line: BaseGeometry, at: Point) -> tuple[Point, Point]:
    (x0, y0), (x1, y1) = shapely.get_coordinates(line)
    if math.dist((x0, y0), (x1, y1)) < 1e-6:
        return at, at
    return (float(x0), float(y0)), (float(x1), float(y1))
