"""Decomposition of a movement with parameters into legs, each from one rest to the next."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from vsnbench.control.command import Controller
from vsnbench.control.controller import MotionController
from vsnbench.control.law import turn_error_rad
from vsnbench.control.path_controller import PathController
from vsnbench.control.settings import MotionSettings
from vsnbench.control.stall import DRIVE_SHARE
from vsnbench.control.standstill import QUIET, StandstillNoise
from vsnbench.control.velocity_controller import VelocityController
from vsnbench.values.action import Action
from vsnbench.values.movement import Drive, Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

ARRIVED_M = 0.012
"""A point nearer than this is reached: turning towards it would cost more accuracy than it gains."""
_ALIGNED_RAD = math.radians(0.3)
"""A smaller difference of headings needs no turn; the straight leg corrects it."""


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
            }
        )

    def controller(
        self, start: Pose, settings: MotionSettings, noise: StandstillNoise = QUIET, start_error: float = 0.0
    ) -> Controller:
        """Return the controller of this leg from odometry `start`; see `MotionController`.

        The settings are those of the robot, and `start_error` is the standard error of `start` along the leg.
        """
        settings = settings.model_copy(update={"stall_s": DRIVE_SHARE * settings.stall_s})
        if self.velocity is not None:
            return VelocityController(self.velocity, start, settings)
        if self.path:
            return PathController(self.path, start, settings)
        return MotionController(
            self.action, start, self.target_heading_rad, self.settings(settings), noise, start_error
        )


class LegPlan:
    """Plans the legs of one movement in the robot's frame, from odometry `start`.

    Each leg is planned from where the leg before it ended.
    """

    def __init__(self, drive: Drive, start: Pose) -> None:
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
                    self._goals.append(_Face(start.heading_rad + heading_rad))
            case Trajectory(points):
                path = tuple(start.compose(Pose(x_m, y_m)).position for x_m, y_m in points)
                self._goals += [_Follow(path), _Reach(path[-1])]
            case Velocity():
                self._goals.append(drive)

    def next(self, pose: Pose) -> Leg | None:
        """Return the next leg from the odometry at rest after the last leg, or None at the end."""
        while self._goals:
            leg, is_last = _leg(self._goals[0], pose)
            if is_last:
                self._goals.pop(0)
            if leg is not None:
                return leg
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


@dataclass(frozen=True, slots=True)
class _Straight:
    distance_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class _Reach:
    position: tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Follow:
    path: tuple[tuple[float, float], ...]


_Goal = _Face | _Straight | _Reach | _Follow | Velocity


def _leg(goal: _Goal, pose: Pose) -> tuple[Leg | None, bool]:
    """Return the next leg towards a goal, and whether it is the goal's last."""
    match goal:
        case _Face(heading_rad, amount_rad, sign):
            error_rad = sign * amount_rad or turn_error_rad(heading_rad, pose.heading_rad)
            return (_turn(error_rad, heading_rad) if abs(error_rad) > _ALIGNED_RAD else None), True
        case _Straight(distance_m, heading_rad):
            action = Action.MOVE_FORWARD if distance_m > 0 else Action.MOVE_BACKWARD
            return Leg(action, abs(distance_m), heading_rad), True
        case _Reach((x_m, y_m)):
            distance_m = math.hypot(x_m - pose.x_m, y_m - pose.y_m)
            if distance_m < ARRIVED_M:
                return None, True
            bearing_rad = math.atan2(y_m - pose.y_m, x_m - pose.x_m)
            error_rad = turn_error_rad(bearing_rad, pose.heading_rad)
            if abs(error_rad) > _ALIGNED_RAD:
                return _turn(error_rad, pose.heading_rad + error_rad), False
            return Leg(Action.MOVE_FORWARD, distance_m, pose.heading_rad + error_rad), True
        case _Follow(path):
            points = ((pose.x_m, pose.y_m), *path)
            return Leg(Action.TRAJECTORY, length_m(points), path=points), True
        case Velocity():
            return Leg(Action.VELOCITY, 0.0, velocity=goal), True


def _turn(error_rad: float, target_heading_rad: float) -> Leg:
    return Leg(Action.TURN_LEFT if error_rad > 0 else Action.TURN_RIGHT, abs(error_rad), target_heading_rad)


def length_m(points: Sequence[tuple[float, float]]) -> float:
    """Return the length of a polyline."""
    return sum(math.dist(a, b) for a, b in pairwise(points))
