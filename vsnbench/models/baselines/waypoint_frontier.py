"""The model `frontier-waypoints`: the search of `frontier`, answered with paths and headings.

Its answers can replace the path of a robot that drives on while the model thinks.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.baselines.frontier import Frontier, FrontierSearch
from vsnbench.models.baselines.standstill import Standstill
from vsnbench.models.task import Task
from vsnbench.models.vlv.detectors.contract import Detection, Reliability
from vsnbench.models.vlv.planner import Planner, Point
from vsnbench.models.vlv.search import Search
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.protocol.execution import Execution
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action, ActionKind, Movement, Trajectory, Waypoint
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose, wrap_angle

_AHEAD_M: Final = 1.0
"""Length of the path in an answer; more where the robot drives on, by what it covers between two answers."""
_LONGEST_M: Final = 4.0
_SPACING_M: Final = 0.15
"""Distance between points of a path."""
_VIEW_S, _VIEW_M, _VIEW_RAD = 1.0, 0.2, math.radians(25)
"""A robot that drives on sees something new after this time, way or turn: about what an action takes."""
_ASIDE_RAD: Final = math.radians(20)
"""A robot that rests first turns to a path with a larger bearing: the guard looks ahead before it leaves."""
_NO_MOTION_M: Final = 0.02
"""A robot that moved less was blocked: where its map says so, it turns before it tries again."""
_CREEP_M: Final = 0.1
"""Length of a path where the guard kept the robot at rest: a shorter path needs less free way straight ahead."""
_CREEP_WITHIN_M: Final = 0.3
"""Paths are short up to this distance from there."""
_MAX_KEPT: Final = 3
"""Times that the guard keeps the robot at one place, after which the end of its path is given up."""
_SCAN_TURNS: Final = 2
"""A scan on a robot that drives on is this number of turns ahead: its views must overlap."""


class WaypointFrontier(Frontier):
    """Answers with the path to the nearest frontier, and with headings while it looks around."""

    card = replace(
        Frontier.card,
        name="frontier-waypoints",
        action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.WAYPOINT, ActionKind.TRAJECTORY}),
    )
    _execution: Execution | None = None

    def begin(self, task: Task) -> None:
        """Start an episode; see `Policy.begin`."""
        self._execution = task.protocol.execution
        super().begin(task)

    def _make_search(self, seed: int) -> Search:
        return WaypointSearch(self.settings, self._planner, seed, self._reliability, execution=self._execution)


@dataclass(frozen=True, slots=True)
class _SearchPlan:
    """What the robot shall do until something new is seen, in the start's frame."""

    decision: Decision
    seen_at: Pose
    seen_s: float
    path: tuple[Point, ...] = ()
    heading_rad: float | None = None
    """Heading to turn to, without a path."""


class WaypointSearch(FrontierSearch):
    """The state of an episode: the search of `FrontierSearch` decides at every new view.

    On a robot that rests while the model thinks every observation is one. On a robot that drives on, observations in
    between follow the plan of the last view.
    """

    def __init__(
        self,
        settings: VLVSettings,
        planner: Planner,
        seed: int,
        reliability: Reliability,
        *,
        execution: Execution | None = None,
    ) -> None:
        super().__init__(settings, planner, seed, reliability)
        self._drives_on = execution is not None
        self._still = Standstill(execution)
        self._plan: _SearchPlan | None = None
        self._last: Pose | None = None
        self._swept_rad = 0.0
        self._is_blocked = False
        """Whether the robot did not leave where it got its last path."""
        self._kept_at: Pose | None = None
        """Where the guard last kept a robot that drives on from leaving."""
        self._kept = 0
        """Times that it was kept there."""

    def step(self, observation: Observation, detections: tuple[Detection, ...], value: float) -> Decision:
        """Return the next answer; see `Search.step`."""
        pose = observation.pose
        covered_m = pose.distance_to(self._last) if self._drives_on and self._last is not None else 0.0
        self._last = pose
        creeps = self._kept_at is not None and pose.distance_to(self._kept_at) < _CREEP_WITHIN_M
        ahead_m = _CREEP_M if creeps else min(_AHEAD_M + 2 * covered_m, _LONGEST_M)
        plan = self._plan
        if plan is not None and not self._is_new(plan, observation):
            movement = _movement(plan, pose, ahead_m)
            if movement is not None:
                return Decision(movement, diagnostics=plan.decision.diagnostics)
        if plan is not None and self._turns_left is not None:
            self._swept_rad += abs(wrap_angle(pose.heading_rad - plan.seen_at.heading_rad))
            turns = self._swept_rad / math.radians(self.settings.turn_deg)
            self._turns_left = max(0, self.settings.scan_turns - round(turns))
        decision = super().step(observation, detections, value)
        if decision.action is Action.STOP:
            return decision
        self._plan = plan = self._planned(decision, observation)
        movement = _movement(plan, pose, ahead_m) or Waypoint(0.0, 0.0, 0.0)
        path_m = movement.length_m if isinstance(movement, Trajectory) else 0.0
        self._before_forward = pose if path_m > self.settings.short_move_m and not self._drives_on else None
        return Decision(movement, diagnostics=decision.diagnostics)

    def _is_new(self, plan: _SearchPlan, observation: Observation) -> bool:
        """Return whether an observation shows something new since the view of a plan."""
        pose = observation.pose
        turned_rad = abs(wrap_angle(pose.heading_rad - plan.seen_at.heading_rad))
        return (
            not self._drives_on
            or observation.stamp_s - plan.seen_s >= _VIEW_S
            or pose.distance_to(plan.seen_at) >= _VIEW_M
            or turned_rad >= _VIEW_RAD
        )

    def _note_last_move(self, pose: Pose, depth_m: npt.NDArray[np.float32], observation: Observation) -> None:
        """Mark an obstacle if a path ended early, or if the guard keeps a robot that drives on from driving."""
        had_path = self._plan is not None and bool(self._plan.path)
        if self._drives_on and self._still.is_stuck(pose, observation.stamp_s):
            self._still.forget()
            self._before_forward = pose if had_path else None
            if had_path:
                self._note_kept(pose)
        before = self._before_forward
        self._is_blocked = had_path and before is not None and before.distance_to(pose) < _NO_MOTION_M
        super()._note_last_move(pose, depth_m, observation)

    def _note_kept(self, pose: Pose) -> None:
        """Count how often the guard keeps the robot at a place; give up the end of the path if it is too often."""
        same_place = self._kept_at is not None and pose.distance_to(self._kept_at) < _NO_MOTION_M
        self._kept = self._kept + 1 if same_place else 1
        self._kept_at = pose
        if self._kept >= _MAX_KEPT and self._plan is not None:
            self._kept = 0
            self._given_up.append(self._plan.path[-1])

    def _begin_scan(self) -> Decision:
        self._swept_rad = 0.0
        return super()._begin_scan()

    def _planned(self, decision: Decision, observation: Observation) -> _SearchPlan:
        pose, shown = observation.pose, decision.diagnostics
        plan = _SearchPlan(decision, pose, observation.stamp_s)
        if len(shown.path) > 1 and math.dist(shown.path[0], shown.path[-1]) > _SPACING_M:
            bearing_rad = _bearing_rad(shown.path, pose)
            if not self._drives_on and abs(bearing_rad) > _ASIDE_RAD:
                return replace(plan, heading_rad=pose.heading_rad + bearing_rad)
            if not (self._is_blocked and decision.action.turns):
                return replace(plan, path=shown.path[1:])
        if decision.action is Action.MOVE_FORWARD:
            ahead = pose.compose(Pose(self.settings.forward_m, 0.0))
            return replace(plan, path=(ahead.position,))
        turn_rad = math.radians(self.settings.turn_deg) * (1 if decision.action is Action.TURN_LEFT else -1)
        if self._turns_left is not None:
            turns = min(self._turns_left + 1, _SCAN_TURNS) if self._drives_on else 1
            return replace(plan, heading_rad=pose.heading_rad + turns * turn_rad)
        if shown.sub_goal is not None and not shown.path:
            x_m, y_m = shown.sub_goal
            return replace(plan, heading_rad=math.atan2(y_m - pose.y_m, x_m - pose.x_m))
        return replace(plan, heading_rad=pose.heading_rad + turn_rad)


def _bearing_rad(path: tuple[Point, ...], pose: Pose) -> float:
    """Return the bearing of a point of a path a little ahead of the robot."""
    ahead = next((point for point in path if math.dist(point, pose.position) > 2 * _SPACING_M), path[-1])
    return wrap_angle(math.atan2(ahead[1] - pose.y_m, ahead[0] - pose.x_m) - pose.heading_rad)


def _movement(plan: _SearchPlan, pose: Pose, ahead_m: float) -> Movement | None:
    """Return what is left of a plan from a pose on, at most a length of its path; None if nothing is."""
    if plan.heading_rad is not None:
        return Waypoint(0.0, 0.0, wrap_angle(plan.heading_rad - pose.heading_rad))
    nearest = min(range(len(plan.path)), key=lambda k: math.dist(plan.path[k], pose.position))
    points: list[Point] = []
    at, length_m = pose.position, 0.0
    for number, point in enumerate(plan.path[nearest:], start=nearest):
        step_m = math.dist(point, at)
        if step_m < _SPACING_M and number + 1 < len(plan.path):
            continue
        at, length_m = point, length_m + step_m
        points.append(Pose(*point).relative_to(pose).position)
        if length_m >= ahead_m:
            break
    if ahead_m < _SPACING_M and length_m > ahead_m:
        x_m, y_m = points[0]
        share = ahead_m / math.hypot(x_m, y_m)
        return Waypoint(share * x_m, share * y_m)
    if len(points) > 1:
        return Trajectory(tuple(points))
    return Waypoint(*points[0]) if length_m > _SPACING_M / 2 else None
