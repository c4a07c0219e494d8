"""How far a place is from a goal, and from where STOP succeeds at it.

Measured on the floor plan to the surveyed footprint of the nearest instance (paper, Section 4.1), from version 2 of
the protocol on in sight: along straight lines that no wall and no closed door crosses.
"""

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.judge import GoalDistance
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.sight import sight
from vsnbench.protocol.site import Site, SiteObject


def distance_to_goal(site: Site, goal: str, fix: Fix, parameters: ProtocolParameters) -> GoalDistance:
    """Measure from the robot's position to the footprint of the nearest instance of the goal category.

    Where distance is measured in sight, the nearest instance is the nearest in sight; with none in sight, the straight
    distance to the nearest is given and `in_sight` is False. 0 inside a footprint.

    Raises:
        ValueError: the site has no instance of the goal.
    """
    here = shapely.Point(fix.pose.position)
    straight = sorted((float(thing.shape.distance(here)), thing.id, thing.shape) for thing in site.instances(goal))
    if not straight:
        raise ValueError(f"site {site.name} has no {goal}")
    nearest_m, nearest, _ = straight[0]
    if not parameters.in_sight:
        return GoalDistance(nearest_m, fix.source, nearest)
    best_m, best = float("inf"), ""
    for straight_m, instance, shape in straight:
        if straight_m >= best_m:
            break
        seen_m = sight(site).distance_m(fix.pose.position, shape)
        if seen_m < best_m:
            best_m, best = seen_m, instance
    if best:
        return GoalDistance(best_m, fix.source, best)
    return GoalDistance(nearest_m, fix.source, nearest, in_sight=False)


def stop_succeeds(site: Site, goal: str, pose: Pose, parameters: ProtocolParameters) -> str | None:
    """Return the goal instance near enough for STOP to succeed at a pose, or None."""
    if not site.instances(goal):
        return None
    distance = distance_to_goal(site, goal, Fix(pose, PoseSource.SURVEYED), parameters)
    return distance.instance if distance.is_under(parameters.success_distance_m) else None


def success_region(site: Site, goal: str, parameters: ProtocolParameters) -> BaseGeometry:
    """Return from where STOP succeeds at a goal, metres in the site's frame; empty when the site has none."""
    return shapely.union_all([region for _, region in success_regions(site, goal, parameters)])


def success_regions(site: Site, goal: str, parameters: ProtocolParameters) -> list[tuple[SiteObject, BaseGeometry]]:
    """Return each instance of a goal and from where STOP succeeds at it."""
    within_m = parameters.success_distance_m
    if not parameters.in_sight:
        return [(thing, thing.shape.buffer(within_m, quad_segs=64)) for thing in site.instances(goal)]
    return [(thing, sight(site).region(thing.shape, within_m)) for thing in site.instances(goal)]
