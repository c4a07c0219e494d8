"""What is wrong with the starting positions of a surveyed site: nobody can stand there, STOP succeeds at once."""

import math
from collections.abc import Iterator

import shapely

from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.free_space import FreeSpace
from vsnbench.protocol.judge import stop_succeeds
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.protocol.survey.building import named_wall
from vsnbench.protocol.survey.finding import Amount, Entry, Severity, SiteFinding, points, shown
from vsnbench.protocol.survey.things import elsewhere
from vsnbench.protocol.survey.ways import way_findings
from vsnbench.protocol.walls import TOUCH_HEIGHT_M, wall_shapes

STARTING_POSITIONS = 15
"""So many a site should have, the same for every goal category and model (paper, Section 4.1)."""


def start_findings(site: Site, space: FreeSpace, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    """Yield what is wrong with the places that episodes start from, and the ways from there to the goals."""
    if len(site.starts) < STARTING_POSITIONS:
        yield SiteFinding(
            Severity.WARNING,
            "few-starts",
            f"site {site.name}",
            f"has {len(site.starts)} starting position{'' if len(site.starts) == 1 else 's'}",
            f"the protocol asks for {STARTING_POSITIONS}, survey {STARTING_POSITIONS - len(site.starts)} more",
            amount=Amount(STARTING_POSITIONS - len(site.starts), "starts"),
        )
    for index in range(len(site.starts)):
        yield from _stands(site, index, space.robot_radius_m)
    for goal in GOAL_CATEGORIES:
        yield from _trivial(site, goal, rules)
    absent = [goal for goal in GOAL_CATEGORIES if not site.instances(goal)]
    if absent:
        them = " or ".join(filter(None, (", ".join(absent[:-1]), absent[-1])))
        yield SiteFinding(
            Severity.WARNING,
            "no-instance",
            f"site {site.name}",
            f"has no {them}",
            f"no trial here searches one; add it to objects if one stands there, category: {absent[0]}"
            + (", for instance" if len(absent) > 1 else ""),
        )
    yield from way_findings(site, space, rules)


def _stands(site: Site, index: int, radius_m: float) -> Iterator[SiteFinding]:
    start = site.starts[index]
    here, name, at = shapely.Point(start.position), f"start {start.number}", shown(start.position)
    entry: tuple[Entry, ...] = (("starts", index),)

    def found(code: str, problem: str, mend: str, amount_m: float, *more: Entry) -> SiteFinding:
        where, amount = points(start.position), Amount(amount_m)
        return SiteFinding(Severity.ERROR, code, name, problem, mend, where, amount, (*entry, *more))

    if not any(room.shape.covers(here) for room in site.rooms):
        rooms = shapely.union_all([room.shape for room in site.rooms])
        off_m = float(rooms.distance(here))
        problem = f"at {at} lies outside every room, {off_m:.2f} m from the nearest"
        yield found("start-outside", problem, elsewhere(start.position, rooms), off_m)
        return
    near = [
        (float(thing.shape.distance(here)), thing.id, ("objects", number))
        for number, thing in enumerate(site.objects)
        if thing.solid and thing.elevation_m < TOUCH_HEIGHT_M
    ]
    near += [
        (float(shape.distance(here)), named_wall(site, number), ("walls", number))
        for number, shape in enumerate(wall_shapes(site))
    ]
    distance_m, nearest, other = min(near)
    if distance_m <= 0:
        yield found("start-inside", f"at {at} lies inside {nearest}", "move it", radius_m, other)
    elif distance_m < radius_m:
        short_m = math.ceil(100 * (radius_m - distance_m) + 1e-6) / 100
        problem = f"at {at} is {distance_m:.2f} m from {nearest}, and the robot's radius is {radius_m:g} m"
        yield found("start-too-near", problem, f"move it {short_m:.2f} m away", radius_m - distance_m, other)


def _trivial(site: Site, goal: str, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    near = [
        (index, start, instance)
        for index, start in enumerate(site.starts)
        if goal not in start.not_for and (instance := stop_succeeds(site, goal, start.pose, rules))
    ]
    if near:
        where = ", ".join(f"{start.number} ({instance})" for _, start, instance in near)
        yield SiteFinding(
            Severity.WARNING,
            "goal-at-start",
            f"goal {goal}",
            f"is reached by STOP at once from start {where}",
            f"move {'it' if len(near) == 1 else 'them'} {rules.success_distance_m:g} m away "
            f"or add not_for: [{goal}] there",
            points(*(start.position for _, start, _ in near)),
            entries=tuple(("starts", index) for index, _, _ in near),
        )
