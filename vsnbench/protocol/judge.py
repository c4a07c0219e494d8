"""The judge: when an episode ends, why, and whether it succeeded (paper, Section 4.1).

Every end has exactly one reason. Only STOP, STEP_LIMIT and COLLISION are results; any other reason makes the
attempt void: the trial must be run again and the episode never enters a success rate.

Distance is measured on the floor plan to the surveyed footprint of the nearest instance, from version 2 of the
protocol on in sight: along straight lines that no wall and no closed door crosses.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.pose import Pose

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.protocol.site import Site, SiteObject


class EndReason(StrEnum):
    """Why an episode ended."""

    STOP = "stop"
    STEP_LIMIT = "step_limit"
    COLLISION = "collision"
    MOTION_FAILED = "motion_failed"
    SENSOR_LOST = "sensor_lost"
    MODEL_ERROR = "model_error"
    MODEL_LOST = "model_lost"
    """A model in another process gave no answer in time."""
    ABORTED = "aborted"
    """A person ended it."""
    INTERRUPTED = "interrupted"
    """The process died."""

    @property
    def is_result(self) -> bool:
        """Whether the episode counts as a trial done."""
        return self in (EndReason.STOP, EndReason.STEP_LIMIT, EndReason.COLLISION)


@dataclass(frozen=True, slots=True)
class GoalDistance:
    """Distance to the nearest instance of the goal, by footprint, and how it was measured."""

    distance_m: float
    source: PoseSource
    instance: str = ""
    in_sight: bool = True
    """False where walls hide every instance and the protocol asks for sight: the distance is the straight one."""

    def is_under(self, success_distance_m: float) -> bool:
        """Whether STOP succeeds at this distance."""
        return self.in_sight and self.distance_m < success_distance_m


@dataclass(frozen=True, slots=True)
class Verdict:
    """A judgement of one episode; `success` is None for a void attempt."""

    end_reason: EndReason
    success: bool | None
    text: str
    distance: GoalDistance | None = None


def end_after(
    actions: int, action: Action, result: MotionResult | None, parameters: "ProtocolParameters"
) -> EndReason | None:
    """Return why the episode ends after its `actions`-th action, or None when it goes on.

    A collision comes before everything else: nothing that the policy does later, or at the same moment, undoes it.
    The last action of the cap ends the episode whatever it is, STOP included.

    Args:
        actions: how many actions the policy has chosen in this episode, this one included; blocked ones count.
        action: the action chosen last.
        result: what became of it; None when the depth guard refused it.
        parameters: the protocol's numbers.
    """
    if result is not None and result.collision is not None:
        return EndReason.COLLISION
    if result is not None and not result.completed:
        return EndReason.SENSOR_LOST if result.sensor_lost else EndReason.MOTION_FAILED
    if actions >= parameters.max_actions:
        return EndReason.STEP_LIMIT
    return EndReason.STOP if action is Action.STOP else None


def distance_to_goal(site: "Site", goal: str, fix: Fix, parameters: "ProtocolParameters") -> GoalDistance:
    """Measure from the robot's position to the footprint of the nearest instance of the goal category.

    Where distance is measured in sight, the nearest instance is the nearest in sight; with none in sight, the straight
    distance to the nearest is given and `in_sight` is False. 0 inside a footprint.

    Raises:
        ValueError: the site has no instance of the goal.
    """
    import shapely

    from vsnbench.protocol.sight import sight

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


def stop_succeeds(site: "Site", goal: str, pose: Pose, parameters: "ProtocolParameters") -> str | None:
    """Return the goal instance near enough for STOP to succeed at a pose, or None."""
    if not site.instances(goal):
        return None
    distance = distance_to_goal(site, goal, Fix(pose, PoseSource.SURVEYED), parameters)
    return distance.instance if distance.is_under(parameters.success_distance_m) else None


def success_region(site: "Site", goal: str, parameters: "ProtocolParameters") -> "BaseGeometry":
    """Return from where STOP succeeds at a goal, metres in the site's frame; empty when the site has none."""
    import shapely

    return shapely.union_all([region for _, region in success_regions(site, goal, parameters)])


def success_regions(
    site: "Site", goal: str, parameters: "ProtocolParameters"
) -> "list[tuple[SiteObject, BaseGeometry]]":
    """Return each instance of a goal and from where STOP succeeds at it."""
    from vsnbench.protocol.sight import sight

    within_m = parameters.success_distance_m
    if not parameters.in_sight:
        return [(thing, thing.shape.buffer(within_m, quad_segs=64)) for thing in site.instances(goal)]
    return [(thing, sight(site).region(thing.shape, within_m)) for thing in site.instances(goal)]


def judge(
    end_reason: EndReason, actions: int, distance: GoalDistance | None, parameters: "ProtocolParameters"
) -> Verdict:
    """Judge an ended episode.

    Success is STOP, in fewer actions than the cap, nearer to the goal than the success distance and, from version 2
    of the protocol on, in sight of it, with no collision.

    Raises:
        ValueError: a STOP cannot be judged without a distance.
    """
    if not end_reason.is_result:
        return Verdict(end_reason, None, f"void: {_WORDS[end_reason]}; the trial must be run again", distance)
    if end_reason is EndReason.COLLISION:
        return Verdict(end_reason, False, f"failed: collision at action {actions}", distance)
    if end_reason is EndReason.STEP_LIMIT or actions >= parameters.max_actions:
        return Verdict(EndReason.STEP_LIMIT, False, f"failed: {actions} actions reached the cap", distance)
    if distance is None:
        raise ValueError("an episode that ended with STOP needs a distance to the goal")
    near = distance.is_under(parameters.success_distance_m)
    comparison = f"{'under' if near else 'not under'} {parameters.success_distance_m:g} m"
    text = (
        f"{'success' if near else 'failed'}: STOP after {actions} actions, {distance.distance_m:.3f} m from "
        f"{distance.instance or 'the goal'} ({distance.source}), "
        f"{comparison if distance.in_sight else 'behind a wall: no instance is in sight'}"
    )
    return Verdict(end_reason, near, text, distance)


_WORDS = {
    EndReason.MOTION_FAILED: "the base could not carry out an action",
    EndReason.SENSOR_LOST: "a sensor went silent or sent what cannot be used",
    EndReason.MODEL_ERROR: "the model failed",
    EndReason.MODEL_LOST: "the model did not answer",
    EndReason.ABORTED: "a person ended the episode",
    EndReason.INTERRUPTED: "the process died",
}
