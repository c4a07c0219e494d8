"""Judge: when and why an episode ends, and whether it succeeded (paper, Section 4.1).

Every end has exactly one reason. Only STOP, COLLISION and the limits (STEP_LIMIT, TIME_LIMIT, PATH_LIMIT) are results;
any other reason makes the attempt void: the trial must be run again, and the episode does not count in success rates.

Distance is measured on the floor plan to the surveyed footprint of the nearest target. From version 2 of the protocol
on it is measured in sight: along straight lines that no wall and no closed door crosses. A region is reached only with
the centre of the base inside it.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from vsnbench.protocol.limits import Spent
from vsnbench.text.distances import distance_text
from vsnbench.text.sanitize import counted
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shapely.geometry.base import BaseGeometry

    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.sites.site import Site
    from vsnbench.sites.targets import Target


class EndReason(StrEnum):
    """Reason of an episode's end."""

    STOP = "stop"
    STEP_LIMIT = "step_limit"
    TIME_LIMIT = "time_limit"
    PATH_LIMIT = "path_limit"
    COLLISION = "collision"
    MOTION_FAILED = "motion_failed"
    SENSOR_LOST = "sensor_lost"
    MODEL_ERROR = "model_error"
    MODEL_LOST = "model_lost"
    """A model in another process did not answer in time."""
    ABORTED = "aborted"
    """The operator ended it."""
    INTERRUPTED = "interrupted"
    """The process died."""

    @property
    def is_result(self) -> bool:
        """Whether the episode completes its trial."""
        return self in (EndReason.STOP, EndReason.COLLISION) or self.is_limit

    @property
    def is_limit(self) -> bool:
        """Whether the episode reached a limit of the protocol."""
        return self in (EndReason.STEP_LIMIT, EndReason.TIME_LIMIT, EndReason.PATH_LIMIT)

    @property
    def ends_leg(self) -> bool:
        """Whether only a goal of a sequence ends, and the next one is given: after STOP and at a limit."""
        return self is EndReason.STOP or self.is_limit


ROBOT_FAILURES = (EndReason.MOTION_FAILED, EndReason.SENSOR_LOST)
"""Void because of the robot: a real one stays where it failed, and a person must move it."""
MODEL_FAILURES = (EndReason.MODEL_ERROR, EndReason.MODEL_LOST)
"""Void because of the model; the robot and other models are not affected. Their texts are from the model."""


@dataclass(frozen=True, slots=True)
class GoalDistance:
    """Distance to the footprint of the nearest target, with its source."""

    distance_m: float
    source: PoseSource
    instance: str = ""
    """Id of the target: an object, `point:…` or `region:…`."""
    in_sight: bool = True
    """False if no target can count: walls hide them all and the protocol requires sight, or the base is outside the
    region; the distance then ignores walls."""
    range_m: tuple[float, float] | None = None
    """Least and greatest distance from the poses of the 95 % region; None if the region is not known."""

    def is_under(self, success_distance_m: float) -> bool:
        """Whether STOP succeeds at this distance."""
        return self.in_sight and self.distance_m < success_distance_m


@dataclass(frozen=True, slots=True)
class Verdict:
    """Judgement of one episode; `success` is None for a void attempt."""

    end_reason: EndReason
    success: bool | None
    text: str
    distance: GoalDistance | None = None


def end_after(
    spent: Spent, action: Action, result: MotionResult | None, parameters: "ProtocolParameters"
) -> EndReason | None:
    """Return the reason why the episode ends after an action, or None if it continues.

    A collision takes precedence over every other reason. The action that reaches a limit ends the episode even if it is
    STOP. If it reaches several limits, the reason is the first of actions, time and path.

    Args:
        spent: what the episode has used, including this action; blocked actions count.
        action: the last action.
        result: its result; None if the depth guard blocked it.
        parameters: the protocol's parameters.
    """
    if result is not None and result.collision is not None:
        return EndReason.COLLISION
    if result is not None and not result.completed and not result.blocked:
        return EndReason.SENSOR_LOST if result.sensor_lost else EndReason.MOTION_FAILED
    if parameters.action_limit is not None and spent.actions >= parameters.action_limit:
        return EndReason.STEP_LIMIT
    if parameters.time_limit_s is not None and spent.time_s >= parameters.time_limit_s:
        return EndReason.TIME_LIMIT
    if parameters.max_path_m is not None and spent.path_m >= parameters.max_path_m:
        return EndReason.PATH_LIMIT
    return EndReason.STOP if action is Action.STOP else None


def distance_to_goal(site: "Site", goal: str, fix: Fix, parameters: "ProtocolParameters") -> GoalDistance:
    """Measure the distance from the robot to the footprint of the nearest target; 0 inside a footprint.

    If the protocol requires sight, only targets in sight count. If none is in sight, the distance ignores walls and
    `in_sight` is False. A region counts if the base is inside it, and is measured only where there is nothing else.

    Raises:
        ValueError: the site has no target of the goal.
    """
    import shapely

    from vsnbench.sites.geometry.line_of_sight import sight
    from vsnbench.sites.targets import targets_of

    here = shapely.Point(fix.pose.position)
    targets = targets_of(site, goal)
    if not targets:
        raise ValueError(f"site {site.name} has no {goal}")
    regions = sorted((float(target.shape.distance(here)), target.id) for target in targets if target.is_region)
    straight = sorted(
        (float(target.shape.distance(here)), target.id, target.shape) for target in targets if not target.is_region
    )
    if regions and (regions[0][0] <= 0 or not straight):
        distance_m, region = regions[0]
        return GoalDistance(distance_m, fix.source, region, in_sight=distance_m <= 0)
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
    """Return the target at which STOP succeeds from a pose, or None."""
    from vsnbench.sites.targets import targets_of

    if not targets_of(site, goal):
        return None
    distance = distance_to_goal(site, goal, Fix(pose, PoseSource.SURVEYED), parameters)
    return distance.instance if distance.is_under(parameters.success_distance_m) else None


def success_region(site: "Site", goal: str, parameters: "ProtocolParameters") -> "BaseGeometry":
    """Return the region where STOP succeeds for a goal, metres in the site's frame; empty without a target."""
    import shapely

    return shapely.union_all([region for _, region in success_regions(site, goal, parameters)])


def success_regions(site: "Site", goal: str, parameters: "ProtocolParameters") -> "list[tuple[Target, BaseGeometry]]":
    """Return each target of a goal with the region where STOP succeeds at it."""
    from vsnbench.sites.geometry.line_of_sight import sight
    from vsnbench.sites.targets import targets_of

    within_m = parameters.success_distance_m

    def region(target: "Target") -> "BaseGeometry":
        if target.is_region:
            return target.shape
        if not parameters.in_sight:
            return target.shape.buffer(within_m, quad_segs=64)
        return sight(site).region(target.shape, within_m)

    return [(target, region(target)) for target in targets_of(site, goal)]


def judge(
    end_reason: EndReason, actions: int, distance: GoalDistance | None, parameters: "ProtocolParameters"
) -> Verdict:
    """Judge an ended episode.

    Success is STOP before any limit is reached, nearer to the goal than the success distance, without a collision and,
    from version 2 of the protocol on, in sight of the goal.

    Raises:
        ValueError: a STOP has no distance.
    """
    by_stack = parameters.execution is not None and parameters.execution.is_by_stack  # it has no actions
    at, after = ("", "") if by_stack else (f" at action {actions}", f" after {counted(actions, 'action')}")
    if not end_reason.is_result:
        return Verdict(end_reason, None, f"void: {_VOID_TEXT[end_reason]}; the trial must be run again", distance)
    if end_reason is EndReason.COLLISION:
        return Verdict(end_reason, False, f"failed: collision{at}", distance)
    limit = parameters.action_limit
    if end_reason is EndReason.STEP_LIMIT or (limit is not None and actions >= limit):
        return Verdict(EndReason.STEP_LIMIT, False, f"failed: cap of {counted(actions, 'action')} reached", distance)
    if end_reason.is_limit:
        return Verdict(end_reason, False, f"failed: {limit_text(end_reason, parameters)}{at}", distance)
    if distance is None:
        raise ValueError("an episode that ended with STOP needs a distance to the goal")
    near = distance.is_under(parameters.success_distance_m)
    far = distance_text(distance.distance_m, parameters.success_distance_m, 3)
    comparison = f"{'under' if near else 'not under'} {parameters.success_distance_m:g} m"
    if is_region(distance.instance):
        comparison = "inside it" if near else "outside it"
    elif not distance.in_sight:
        comparison = "behind a wall: no instance is in sight"
    text = (
        f"{'success' if near else 'failed'}: STOP{after}, {far} m from "
        f"{distance.instance or 'the goal'} ({distance.source}), {comparison}"
    )
    return Verdict(end_reason, near, text, distance)


def judge_sequence(earlier: "Sequence[bool | None]", last: Verdict, goals: int) -> Verdict:
    """Judge an ended episode of a sequence: it succeeds if every goal was reached.

    Args:
        earlier: success at each goal before the last one that was given.
        last: verdict of that one, which is the episode's end.
        goals: number of goals of the sequence.
    """
    if last.success is None:
        return last
    reached = sum(success is True for success in (*earlier, last.success))
    outcome = "success" if reached == goals else "failed"
    text = f"{outcome}: {reached} of {goals} goals reached; the last: {last.text}"
    return replace(last, success=reached == goals, text=text)


def is_region(instance: str) -> bool:
    """Return whether the id of a target is that of a region, in which the base must stand."""
    return instance.startswith("region:")


def limit_text(end_reason: EndReason, parameters: "ProtocolParameters") -> str:
    """Return which limit an episode reached, with its value if the parameters have it."""
    is_time = end_reason is EndReason.TIME_LIMIT
    limit = parameters.time_limit_s if is_time else parameters.max_path_m
    value = "" if limit is None else f" of {limit:g} {'s' if is_time else 'm'}"
    return f"{'time' if is_time else 'path'} limit{value} reached"


_VOID_TEXT = {
    EndReason.MOTION_FAILED: "the base could not carry out an action",
    EndReason.SENSOR_LOST: "a sensor went silent or sent what cannot be used",
    EndReason.MODEL_ERROR: "the model failed",
    EndReason.MODEL_LOST: "the model did not answer",
    EndReason.ABORTED: "a person ended the episode",
    EndReason.INTERRUPTED: "the process died",
}
