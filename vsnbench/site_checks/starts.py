"""Checks of starting positions: outside the rooms, too near to a solid object, or within reach of a goal."""

import math
from collections.abc import Iterator

import shapely

from vsnbench.protocol.free_space import FreeSpace
from vsnbench.protocol.judge import stop_succeeds
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.site_checks.finding import Entry, Severity, SiteFinding, goal_entries, join_names, point_text, points
from vsnbench.site_checks.objects import suggest_position
from vsnbench.site_checks.reachability import checked_goals, named_solids, reachability_findings
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import Site

STARTING_POSITIONS = 15
"""Number of starting positions, the same for every goal category and model (paper, Section 4.1)."""


def start_findings(site: Site, space: FreeSpace, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    """Yield findings about starting positions and the paths from them to the goals."""
    if len(site.starts) < STARTING_POSITIONS:
        yield SiteFinding(
            Severity.WARNING,
            "few-starts",
            f"site {site.name}",
            f"has {len(site.starts)} starting position{'' if len(site.starts) == 1 else 's'}",
            f"the protocol requires {STARTING_POSITIONS}: survey {STARTING_POSITIONS - len(site.starts)} more",
            amount=STARTING_POSITIONS - len(site.starts),
            unit="starts",
        )
    for index in range(len(site.starts)):
        yield from _placement(site, index, space.robot_radius_m)
    for goal in checked_goals(site):
        yield from _trivial(site, goal, rules)
    absent = [goal for goal in GOAL_CATEGORIES if not site.instances(goal)]
    if absent:
        yield SiteFinding(
            Severity.WARNING,
            "no-instance",
            f"site {site.name}",
            f"has no {join_names(absent, 'or')}",
            "this site has no trials with such a goal; if it has such an object, add it to objects with category: "
            + absent[0]
            + (", for instance" if len(absent) > 1 else ""),
        )
    yield from reachability_findings(site, space, rules)


def _placement(site: Site, index: int, radius_m: float) -> Iterator[SiteFinding]:
    start = site.starts[index]
    here, name, at = shapely.Point(start.position), f"start {start.number}", point_text(start.position)

    def found(code: str, problem: str, advice: str, amount_m: float, *more: Entry) -> SiteFinding:
        entries = (("starts", index), *more)
        return SiteFinding(Severity.ERROR, code, name, problem, advice, points(start.position), amount_m, entries)

    if not any(room.shape.covers(here) for room in site.rooms):
        rooms = shapely.union_all([room.shape for room in site.rooms])
        off_m = float(rooms.distance(here))
        problem = f"at {at} is outside every room, {off_m:.2f} m from the nearest"
        yield found("start-outside", problem, suggest_position(start.position, rooms), off_m)
        return
    distance_m, nearest, other = min(
        (float(shape.distance(here)), solid, entry) for shape, solid, entry in named_solids(site)
    )
    if distance_m <= 0:
        yield found("start-inside", f"at {at} is inside {nearest}", "move it", radius_m, other)
    elif distance_m < radius_m:
        short_m = math.ceil(100 * (radius_m - distance_m) + 1e-6) / 100
        problem = f"at {at} is {distance_m:.2f} m from {nearest}, less than the robot's radius of {radius_m:g} m"
        yield found("start-too-near", problem, f"move it {short_m:.2f} m away", radius_m - distance_m, other)


def _trivial(site: Site, goal: str, rules: ProtocolParameters) -> Iterator[SiteFinding]:
    near = [
        (index, start, instance)
        for index, start in enumerate(site.starts)
        if (goal, start.number) not in site.excluded and (instance := stop_succeeds(site, goal, start.pose, rules))
    ]
    if near:
        where = ", ".join(f"{start.number} ({instance})" for _, start, instance in near)
        yield SiteFinding(
            Severity.WARNING,
            "goal-at-start",
            f"goal {goal}",
            f"is reached without a move from start {where}",
            f"move {'it' if len(near) == 1 else 'them'} {rules.success_distance_m:g} m away "
            + (
                f"or add not_for: [{goal}] there"
                if site.goal(goal) is None
                else "or leave them out of the goal's starts"
            ),
            points(*(start.position for _, start, _ in near)),
            entries=(*(("starts", index) for index, _, _ in near), *goal_entries(site, [goal])),
        )
