"""Decomposition of a movement with parameters into legs, each from one rest to the next."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from vsnbench.control.command import Controller
from vsnbench.control.controller import MotionController
from vsnbench.control.law import turn_error_rad
from vsnbench.control.path_controller import PathController
from vsnbench.control.response import BaseResponse
from vsnbench.control.settings import MotionSettings
from vsnbench.control.stall import DRIVE_SHARE
from vsnbench.control.standstill import QUIET, StandstillNoise
from vsnbench.control.velocity_controller import VelocityController
from vsnbench.values.action import Action
from vsnbench.values.movement import Drive, Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

ARRIVED_M = 0.012
"""A point nearer than this is reached: turning towards it would cost more accuracy than it gains."""
MISSED_M = 0.015
"""A point farther than this at the end, by the odometry at rest, was not reached."""
_ALIGNED_RAD = math.radians(0.3)
"""A smaller difference of headings needs no turn; the straight leg corrects it."""
_FACED_RAD = math.radians(0.1)
"""A requested heading is reached below this difference (paper, Section 3.1.3)."""
_FACING_RAD = math.radians(5)
"""A smaller difference from the direction at the end of a path needs no turn."""
_SHORT_M = 0.15
"""Largest remainder that is driven backwards if the point lies behind: the robot has just come from there."""
_CORRECTIONS = 3
"""Largest number of times that a missed point is approached again."""


@dataclass(frozen=True, slots=True)
class Leg:
    """One motion from rest to rest."""

    action: Action
    """MOVE_FORWARD, MOVE_BACKWARD, TURN_LEFT or TURN_RIGHT; TRAJECTORY or VELOCITY for the other two."""
    amount: float
    """Metres of a straight or curved leg, radians of a turn, not negative; 0 for a velocity."""
    target_heading_rad: float = 0.0
    """Absolute heading at the end of a straight leg or a turn, in the frame of the odometry."""
    path: tuple[tuple[float, float], ...] = ()
    """Points of a curved leg in the frame of the odometry, from the robot's position on."""
    velocity: Velocity | None = None
    target: tuple[float, float] | None = None
    """End of a straight leg in the frame of the odometry; None for a distance alone."""
    tolerance_rad: float = 0.0
    """Tolerance of a turn whose heading the next leg corrects or that is not exact; 0 for that of the robot."""

    @property
    def translates(self) -> bool:
        """Whether the robot leaves its position."""
        if self.velocity is not None:
            return self.velocity.linear_m_s != 0.0
        return not self.action.turns

    def settings(self, settings: MotionSettings) -> MotionSettings:
        """Return the settings of this leg: with the acceleration of a discrete action, and slower if it is shorter."""
        if self.velocity is not None or self.amount <= 0:
            return settings
        standard = settings.turn_rad if self.action.turns else settings.forward_m
        share = min(1.0, standard / self.amount)
        slower = math.sqrt(min(1.0, self.amount / standard))
        way, speed = ("turn_rad", "angular_rad_s") if self.action.turns else ("forward_m", "linear_m_s")
        return settings.model_copy(
            update={
                way: self.amount,
                speed: getattr(settings, speed) * slower,
                "acceleration_share": settings.acceleration_share * share,
                "deceleration_share": settings.deceleration_share * share,
                "heading_tolerance_rad": max(settings.heading_tolerance_rad, self.tolerance_rad),
            }
        )

    def controller(
        self,
        start: Pose,
        settings: MotionSettings,
        noise: StandstillNoise = QUIET,
        start_error: float = 0.0,
        response: BaseResponse | None = None,
    ) -> Controller:
        """Return the controller of this leg from odometry `start`; see `MotionController`.

        The settings are those of the robot, and `start_error` is the standard error of `start` along the leg.
        """
        settings = settings.model_copy(update={"stall_s": DRIVE_SHARE * settings.stall_s})
        if self.velocity is not None:
            return VelocityController(self.velocity, start, settings, noise)
        if self.path:
            return PathController(self.path, settings, noise, response)
        return MotionController(
            self.action,
            start,
            self.target_heading_rad,
            self.settings(settings),
            noise,
            0.0 if self.target else start_error,
            response,
            self.target,
        )


class LegPlan:
    """Plans the legs of one movement in the robot's frame, from odometry `start`.

    Each leg is planned from where the leg before it ended.

    Attributes:
        failure: why the movement did not reach its end although every leg was done, or an empty string.
    """

    def __init__(self, drive: Drive, start: Pose) -> None:
        self.failure = ""
        self._goals: list[_Goal] = []
        match drive:
            case Move(distance_m, turn_rad):
                heading_rad = start.heading_rad + turn_rad
                if turn_rad:
                    self._goals.append(_Face(heading_rad, abs(turn_rad), math.copysign(1.0, turn_rad)))
                if distance_m:
                    self._goals.append(_Straight(distance_m, heading_rad))
            case Waypoint(x_m, y_m, heading_rad):
                self._goals.append(_Reach(start.compose(Pose(x_m, y_m)).position))
                if heading_rad is not None:
                    self._goals.append(_Face(start.heading_rad + heading_rad, aligned_rad=_FACED_RAD))
            case Trajectory(points):
                path = tuple(start.compose(Pose(x_m, y_m)).position for x_m, y_m in points)
                (ax, ay), (bx, by) = ((start.x_m, start.y_m), *path)[-2:]
                self._goals += [_Follow(path), _Reach(path[-1], approaches=1)]
                if (ax, ay) != (bx, by):
                    self._goals.append(_Face(math.atan2(by - ay, bx - ax), aligned_rad=_FACING_RAD))
            case Velocity():
                self._goals.append(drive)

    def next(self, pose: Pose) -> Leg | None:
        """Return the next leg from the odometry at rest after the last leg, or None at the end or after a failure."""
        while self._goals:
            goal = self._goals.pop(0)
            leg, again = _leg(goal, pose)
            if again is not None:
                self._goals.insert(0, again)
            if leg is not None:
                return leg
            if isinstance(goal, _Reach) and (off_m := goal.distance_m(pose)) > MISSED_M:
                self.failure = f"ended {off_m * 1000:.0f} mm from the requested point, after {_CORRECTIONS} corrections"
                self._goals.clear()
        return None


def longest_duration_s(drive: Drive, settings: MotionSettings) -> float:
    """Return a time in which a movement ends, done or failed; each leg has its own limit below it."""
    match drive:
        case Velocity():
            return drive.duration_s + settings.timeout_s
        case Move(distance_m, turn_rad):
            way_m, turned_rad, legs = abs(distance_m), abs(turn_rad), 2
        case Waypoint(x_m, y_m):
            way_m, turned_rad, legs = math.hypot(x_m, y_m), math.tau, 3
        case Trajectory(points):
            way_m, turned_rad, legs = drive.length_m, math.pi * (len(points) + 1), 2
    return 2 * way_m / settings.linear_m_s + 2 * turned_rad / settings.angular_rad_s + legs * settings.timeout_s


@dataclass(frozen=True, slots=True)
class _Face:
    """Turn to an absolute heading; by a given angle if there is one, because a full turn has no shorter direction."""

    heading_rad: float
    amount_rad: float = 0.0
    sign: float = 1.0
    aligned_rad: float = _ALIGNED_RAD
    """A smaller difference needs no turn."""


@dataclass(frozen=True, slots=True)
class _Straight:
    distance_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class _Reach:
    position: tuple[float, float]
    approaches: int = 0
    """Straight legs to the point so far."""

    def distance_m(self, pose: Pose) -> float:
        return math.hypot(self.position[0] - pose.x_m, self.position[1] - pose.y_m)


@dataclass(frozen=True, slots=True)
class _Follow:
    path: tuple[tuple[float, float], ...]


_Goal = _Face | _Straight | _Reach | _Follow | Velocity


def _leg(goal: _Goal, pose: Pose) -> tuple[Leg | None, _Goal | None]:
    """Return the next leg towards a goal, and the goal that is left after it."""
    match goal:
        case _Face(heading_rad, amount_rad, sign, aligned_rad):
            error_rad = sign * amount_rad or turn_error_rad(heading_rad, pose.heading_rad)
            turn = _turn(error_rad, heading_rad, 0.2 * aligned_rad)
            return (turn if abs(error_rad) > aligned_rad else None), None
        case _Straight(distance_m, heading_rad):
            action = Action.MOVE_FORWARD if distance_m > 0 else Action.MOVE_BACKWARD
            end = pose.x_m + distance_m * math.cos(heading_rad), pose.y_m + distance_m * math.sin(heading_rad)
            return Leg(action, abs(distance_m), heading_rad, target=end), None
        case _Reach():
            return _leg_to_point(goal, pose)
        case _Follow(path):
            points = ((pose.x_m, pose.y_m), *path)
            return Leg(Action.TRAJECTORY, length_m(points), path=points), None
        case Velocity():
            return Leg(Action.VELOCITY, 0.0, velocity=goal), None


def _leg_to_point(goal: _Reach, pose: Pose) -> tuple[Leg | None, _Reach | None]:
    """Return a turn towards a point, or a straight leg to it; a small remainder behind the robot is reversed."""
    distance_m = goal.distance_m(pose)
    if distance_m < ARRIVED_M or goal.approaches > _CORRECTIONS:
        return None, None
    x_m, y_m = goal.position
    bearing_rad = math.atan2(y_m - pose.y_m, x_m - pose.x_m)
    error_rad = turn_error_rad(bearing_rad, pose.heading_rad)
    action = Action.MOVE_FORWARD
    is_short = goal.approaches > 0 and distance_m < _SHORT_M
    if is_short and abs(error_rad) > math.pi / 2:
        action, error_rad = Action.MOVE_BACKWARD, turn_error_rad(bearing_rad + math.pi, pose.heading_rad)
    # The heading matters only as far as it moves the end of the leg.
    aligned_rad = math.asin(min(0.5 * ARRIVED_M / distance_m, 1.0)) if is_short else _ALIGNED_RAD
    if abs(error_rad) > aligned_rad:
        return _turn(error_rad, pose.heading_rad + error_rad, aligned_rad), goal
    amount_m = distance_m * math.cos(error_rad) if is_short else distance_m
    leg = Leg(action, amount_m, pose.heading_rad + (0.0 if is_short else error_rad), target=goal.position)
    return leg, replace(goal, approaches=goal.approaches + 1)


def _turn(error_rad: float, target_heading_rad: float, tolerance_rad: float) -> Leg:
    action = Action.TURN_LEFT if error_rad > 0 else Action.TURN_RIGHT
    return Leg(action, abs(error_rad), target_heading_rad, tolerance_rad=tolerance_rad)


def length_m(points: Sequence[tuple[float, float]]) -> float:
    """Return the length of a polyline."""
    return sum(math.dist(a, b) for a, b in pairwise(points))
