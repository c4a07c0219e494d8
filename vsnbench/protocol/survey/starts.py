"""What is wrong with the starting positions of a surveyed site: nobody can stand there, no way leads to a goal."""

import math
from collections.abc import Iterator

import shapely

from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.free_space import FreeSpace
from vsnbench.protocol.goal_distance import stop_succeeds
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.protocol.survey.finding import SiteFinding, between, error, shown, warning
from vsnbench.protocol.walls import TOUCH_HEIGHT_M, wall_shapes

STARTING_POSITIONS = 15
"""So many a site should have, the same for every goal category and model (paper, Section 4.1)."""


def start_findings(site: Site, space: FreeSpace, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    """Yield what is wrong with the places that episodes start from."""
    if len(site.starts) < STARTING_POSITIONS:
        yield warning(
            f"site {site.name}",
            f"has {len(site.starts)} starting position{'' if len(site.starts) == 1 else 's'}",
            f"the protocol asks for {STARTING_POSITIONS}",
        )
    yield from _headings(site)
    for start in site.starts:
        yield from _stands(site, start, space.robot_radius_m)
    for goal in GOAL_CATEGORIES:
        if site.instances(goal):
            yield from _trivial(site, goal, rules)
            yield from _ways(site, goal, space, rules)
        else:
            yield warning(f"site {site.name}", f"has no {goal}", "the protocol's goal category has no instance here")
    yield from _narrow_doors(site, space.robot_radius_m)


def _headings(site: Site) -> Iterator[SiteFinding]:
    given = [start.heading_deg for start in site.starts] + [thing.heading_deg for thing in site.objects]
    small = [abs(heading) for heading in given if abs(heading) <= math.tau]
    slanted = [heading for heading in small if heading % 1 > 1e-6]
    turned = sum(abs(heading) > math.tau for heading in given)
    if len(slanted) > len(given) / 3 and turned <= len(slanted) / 4:
        few = f"only {turned} of {len(given)} things" if turned else "nothing"
        yield warning(f"site {site.name}", f"turns {few} by more than {max(small):.2f}°", "headings are degrees")


def _stands(site: Site, start: StartingPosition, radius_m: float) -> Iterator[SiteFinding]:
    here, name, at = shapely.Point(start.position), _named(start), start.position
    if not any(room.shape.covers(here) for room in site.rooms):
        off_m = min(float(room.shape.distance(here)) for room in site.rooms)
        yield error(
            name, f"at {shown(at)} lies outside every room, {off_m:.2f} m from the nearest", "measure it again", at
        )
        return
    things = [
        (float(thing.shape.distance(here)), thing.id)
        for thing in site.objects
        if thing.solid and thing.elevation_m < TOUCH_HEIGHT_M
    ]
    walls = [
        (float(shape.distance(here)), f"wall {number} ({between(wall.start, wall.end)})")
        for number, (wall, shape) in enumerate(zip(site.walls, wall_shapes(site), strict=True), start=1)
    ]
    distance_m, nearest = min(things + walls)
    if distance_m <= 0:
        yield error(name, f"at {shown(at)} lies inside {nearest}", "move it", at)
    elif distance_m < radius_m:
        yield error(
            name,
            f"at {shown(at)} is {distance_m:.2f} m from {nearest}, and the robot's radius is {radius_m:g} m",
            f"move it {math.ceil(100 * (radius_m - distance_m) + 1e-6) / 100:.2f} m away",
            at,
        )


def _trivial(site: Site, goal: str, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    found = [
        (start, stop_succeeds(site, goal, start.pose, rules)) for start in site.starts if goal not in start.not_for
    ]
    near = [(start, instance) for start, instance in found if instance]
    if near:
        where = ", ".join(f"{start.number} ({instance})" for start, instance in near)
        yield warning(
            f"goal {goal}",
            f"is reached by STOP at once from starting position {where}",
            f"move {'it' if len(near) == 1 else 'them'} or add not_for: [{goal}] there",
            *(start.position for start, _ in near),
        )


def _ways(site: Site, goal: str, space: FreeSpace, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    asked = [start for start in site.starts if goal not in start.not_for]
    lost = [start for start in asked if not math.isfinite(space.geodesic_to_goal_m(start.pose, goal, rules))]
    if not asked:
        yield warning(f"goal {goal}", "is excluded from every starting position by not_for", "leave one that uses it")
    elif len(lost) == len(asked):
        yield error(
            f"goal {goal}",
            f"cannot be reached from any starting position with a robot of radius {space.robot_radius_m:g} m",
            "look for a door that is closed or too narrow, or furniture in the way",
        )
    elif lost:
        numbers = ", ".join(str(start.number) for start in lost)
        yield error(
            f"goal {goal}",
            f"cannot be reached from starting position {numbers} with a robot of radius {space.robot_radius_m:g} m",
            "look for what shuts it in",
            *(start.position for start in lost),
        )


def _narrow_doors(site: Site, radius_m: float) -> Iterator[SiteFinding]:
    for door in site.doors:
        if not door.closed and door.clear_width_m <= 2 * radius_m:
            yield warning(
                door.name,
                f"({between(door.start, door.end)}) is {door.clear_width_m:.2f} m wide, the robot {2 * radius_m:.2f} m",
                "it cannot pass",
                door.start,
                door.end,
            )


def _named(start: StartingPosition) -> str:
    return f"starting position {start.number}"
