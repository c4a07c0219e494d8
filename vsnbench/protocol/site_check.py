"""Says in words what is wrong with a surveyed site, before a robot or a simulator finds out."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import shapely
from shapely.geometry import Point as PlanPoint
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.categories import CATEGORIES, GOAL_CATEGORIES
from vsnbench.protocol.free_space import FreeSpace, free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site, SiteObject, StartingPosition, Wall
from vsnbench.protocol.walls import TOUCH_HEIGHT_M, wall_shapes, walls_of

STARTING_POSITIONS = 15
"""So many a site should have, the same for every goal category and model (paper, Section 4.1)."""
_TOUCHING_M2 = 5e-4
"""Overlaps smaller than this are a survey's rounding."""
_RUN_TOGETHER_M = 0.04
"""Openings may share so much of their wall before they count as being in the same place."""


class Severity(StrEnum):
    """How bad a finding is: trials on a site with errors are not worth running."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong, or odd, in words."""

    severity: Severity
    message: str


def check_site(site: Site, robot_radius_m: float, parameters: ProtocolParameters | None = None) -> list[Finding]:
    """Return everything that is wrong with a site for a robot of that radius; errors first, empty when it is sound."""
    rules = ProtocolParameters() if parameters is None else parameters
    findings = [*_building(site), *_objects(site), *_starts(site, robot_radius_m, rules)]
    findings += _reach(site, free_space(site, robot_radius_m), rules)
    return sorted(findings, key=lambda finding: finding.severity is not Severity.ERROR)


def _error(message: str) -> Finding:
    return Finding(Severity.ERROR, message)


def _warning(message: str) -> Finding:
    return Finding(Severity.WARNING, message)


def _building(site: Site) -> Iterator[Finding]:
    for one, other in itertools.combinations(site.rooms, 2):
        shared = one.shape.intersection(other.shape).area
        if shared > _TOUCHING_M2:
            yield _error(f"rooms {one.name!r} and {other.name!r} overlap by {shared:.2f} m²")
    for (i, one_wall), (j, other_wall) in itertools.combinations(enumerate(site.walls, start=1), 2):
        length_m = _shared_length_m(one_wall, other_wall)
        if length_m > 0:
            yield _error(
                f"wall {i} ({_between(one_wall)}) and wall {j} ({_between(other_wall)}) overlap along {length_m:.2f} m"
            )
    for door in site.doors:
        if not walls_of(site, door.start, door.end):
            yield _error(f"{door.name} ({_at(door.start)} to {_at(door.end)}) lies on no wall")
    for window in site.windows:
        if not walls_of(site, window.start, window.end):
            yield _error(f"window from {_at(window.start)} to {_at(window.end)} lies on no wall")
    openings = [(door.name, door.centre_line) for door in site.doors]
    openings += [(f"window from {_at(window.start)}", window.centre_line) for window in site.windows]
    for (name, line), (other_name, other_line) in itertools.combinations(openings, 2):
        if line.buffer(0.01).intersection(other_line).length > _RUN_TOGETHER_M:
            yield _error(f"{name} and {other_name} overlap")


def _shared_length_m(one: Wall, other: Wall) -> float:
    """Return along how many metres two walls run in the same place; 0 for walls that merely meet or cross."""
    across = (one.end[0] - one.start[0]) * (other.end[1] - other.start[1])
    across -= (one.end[1] - one.start[1]) * (other.end[0] - other.start[0])
    if abs(across) > math.sin(math.radians(5)) * one.length_m * other.length_m:
        return 0.0
    strip = one.centre_line.buffer((one.thickness_m + other.thickness_m) / 2 - 1e-3, cap_style="flat")
    length_m = float(strip.intersection(other.centre_line).length)
    return length_m if length_m > (one.thickness_m + other.thickness_m) / 2 else 0.0


def _objects(site: Site) -> Iterator[Finding]:
    rooms = shapely.union_all([room.shape for room in site.rooms])
    walls = shapely.union_all(wall_shapes(site))
    doorways = [(door.name, door.centre_line.buffer(0.05, cap_style="flat")) for door in site.doors]
    for thing in site.objects:
        if thing.category not in CATEGORIES:
            known = ", ".join(sorted(CATEGORIES))
            yield _error(f"{thing.id}: unknown category {thing.category!r}; known are {known}")
        if not rooms.intersects(thing.shape):
            yield _error(f"{thing.id} stands outside every room")
        elif thing.shape.difference(rooms).area > _TOUCHING_M2 or thing.shape.intersection(walls).area > _TOUCHING_M2:
            yield _error(f"{thing.id} sticks through a wall")
        if thing.elevation_m + thing.size_m[2] > site.ceiling_height_m + 1e-6:
            yield _error(f"{thing.id} reaches above the ceiling of {site.ceiling_height_m:g} m")
        for name, doorway in doorways:
            if thing.solid and thing.shape.intersection(doorway).area > _TOUCHING_M2:
                yield _error(f"{thing.id} stands in the opening of the {name}")
    solid = [thing for thing in site.objects if thing.solid]
    for one, other in itertools.combinations(solid, 2):
        shared = one.shape.intersection(other.shape).area
        if shared > _TOUCHING_M2 and not _above(one, other) and not _above(other, one):
            yield _error(f"{one.id} and {other.id} overlap by {shared * 1e4:.0f} cm²")


def _above(upper: SiteObject, lower: SiteObject) -> bool:
    return upper.elevation_m >= lower.elevation_m + lower.size_m[2] - 0.01


def _starts(site: Site, radius_m: float, rules: ProtocolParameters) -> Iterator[Finding]:
    if len(site.starts) < STARTING_POSITIONS:
        plural = "" if len(site.starts) == 1 else "s"
        yield _warning(f"{len(site.starts)} starting position{plural}; the protocol asks for {STARTING_POSITIONS}")
    walls = shapely.union_all(wall_shapes(site))
    for start in site.starts:
        here, name = PlanPoint(start.position), f"starting position {start.number}"
        if not any(room.shape.covers(here) for room in site.rooms):
            yield _error(f"{name} at {_at(start.position)} lies outside every room")
            continue
        yield from _start_is_free(site, start, walls, radius_m)
        for goal in GOAL_CATEGORIES:
            near = [thing.id for thing in site.instances(goal) if _is_near(thing.shape, here, rules)]
            if near:
                yield _warning(
                    f"{name} is nearer than {rules.success_distance_m:g} m to {near[0]}: STOP succeeds there"
                )


def _start_is_free(site: Site, start: StartingPosition, walls: BaseGeometry, radius_m: float) -> Iterator[Finding]:
    here, name = PlanPoint(start.position), f"starting position {start.number}"
    things = [
        (float(thing.shape.distance(here)), thing.id)
        for thing in site.objects
        if thing.solid and thing.elevation_m < TOUCH_HEIGHT_M
    ]
    distance_m, nearest = min([*things, (float(walls.distance(here)), "a wall")])
    if distance_m <= 0:
        yield _error(f"{name} at {_at(start.position)} lies inside {nearest}")
    elif distance_m < radius_m:
        yield _error(f"{name} is {distance_m:.2f} m from {nearest}; the robot's radius is {radius_m:g} m")


def _is_near(shape: Polygon, here: PlanPoint, rules: ProtocolParameters) -> bool:
    return bool(shape.distance(here) < rules.success_distance_m)


def _reach(site: Site, space: FreeSpace, rules: ProtocolParameters) -> Iterator[Finding]:
    for goal in GOAL_CATEGORIES:
        if not site.instances(goal):
            yield _warning(f"no {goal}: the protocol's goal category has no instance here")
            continue
        lost = [
            start.number
            for start in site.starts
            if not math.isfinite(space.geodesic_to_goal_m(start.pose, goal, rules))
        ]
        if len(lost) == len(site.starts):
            yield _error(f"no starting position can reach a {goal} with a robot of radius {space.robot_radius_m:g} m")
        elif lost:
            numbers = ", ".join(str(number) for number in lost)
            yield _error(f"no way to a {goal} from starting position {numbers}")


def _at(point: tuple[float, float]) -> str:
    return f"({point[0]:g}, {point[1]:g})"


def _between(wall: Wall) -> str:
    return f"{_at(wall.start)} to {_at(wall.end)}"
