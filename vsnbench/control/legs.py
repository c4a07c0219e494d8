"""Decomposition of a movement into legs, each from one rest to the next."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import assert_never

from vsnbench.control.command import Controller
from vsnbench.control.controller import MotionController
from vsnbench.control.law import ideal_duration_s, turn_error_rad
from vsnbench.control.leg import Leg
from vsnbench.control.paths.path_controller import PathController
from vsnbench.control.response import BaseResponse
from vsnbench.control.settings import MotionSettings
from vsnbench.control.stall import DRIVE_SHARE
from vsnbench.control.standstill import QUIET, StandstillNoise
from vsnbench.control.velocity_controller import VelocityController
from vsnbench.values.movement import Drive, Move, Sidestep, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

ARRIVED_M = 0.012
"""A point nearer than this is reached: turning towards it would cost more accuracy than it gains. A robot with a wider
tolerance reaches it within that tolerance."""
MISSED_M = 0.015
"""A point farther than this at the end, by the odometry at rest, was not reached."""
_ALIGNED_RAD = math.radians(0.3)
"""A smaller difference of headings needs no turn; the straight leg corrects it."""
_REST_FACTOR = 1.25
"""A difference below this multiple of the robot's tolerance at the end of a leg comes from rolling to rest: another leg
would end at once."""
_TURNS = 2
"""Largest number of turns before a straight leg, which steers as well."""
_FACED_RAD = math.radians(0.1)
"""A requested heading is reached below this difference (paper, Section 3.1.3)."""
_FACING_RAD = math.radians(5)
"""A smaller difference from the direction at the end of a path needs no turn."""
_SHORT_M = 0.15
"""Largest remainder that is driven backwards if the point lies behind: the robot has just come from there."""
_PAPERS = MotionSettings()
_CORRECTIONS = 3
"""Largest number of times that a missed point is approached again."""


class LegPlan:
    """Plans the legs of one movement in the robot's frame, from odometry `start`.

    Each leg is planned from where the leg before it ended.

    Args:
        movement: the movement.
        start: odometry at its begin.
        settings: settings of the robot, for its tolerances.

    Attributes:
        failure: why the movement did not reach its end although every leg was done, or an empty string.
    """

    def __init__(self, movement: Drive, start: Pose, settings: MotionSettings = _PAPERS) -> None:
        self.failure = ""
        self._arrived_m = max(ARRIVED_M, settings.position_tolerance_m)
        self._missed_m = max(MISSED_M, _REST_FACTOR * settings.position_tolerance_m)
        is_wide = settings.heading_tolerance_rad > _FACED_RAD
        self._least_turn_rad = _REST_FACTOR * settings.heading_tolerance_rad if is_wide else 0.0
        self._pose = start
        self._legs = self._planned(movement, start)

    def next(self, pose: Pose) -> Leg | None:
        """Return the next leg from the odometry at rest after the last leg, or None at the end or after a failure."""
        self._pose = pose
        return next(self._legs, None)

    def _planned(self, movement: Drive, start: Pose) -> Iterator[Leg]:
        """Yield the legs; `self._pose` is the odometry before each of them."""
        match movement:
            case Move(distance_m, turn_rad, holds_heading=True):
                if turn_rad:
                    yield Leg(turn_rad, turns=True)
                if distance_m:
                    yield Leg(distance_m)
            case Move(distance_m, turn_rad):
                heading_rad = start.heading_rad + turn_rad
                if abs(turn_rad) > _ALIGNED_RAD:  # not the shorter direction: a full turn has none
                    yield Leg(turn_rad, heading_rad, turns=True, tolerance_rad=0.2 * _ALIGNED_RAD)
                if distance_m:
                    yield self._straight(distance_m, heading_rad)
            case Waypoint(x_m, y_m, heading_rad):
                yield from self._reach(start.compose(Pose(x_m, y_m)).position)
                if heading_rad is not None and not self.failure:
                    yield from self._face(start.heading_rad + heading_rad, _FACED_RAD)
            case Trajectory(points):
                path = ((start.x_m, start.y_m), *(start.compose(Pose(x_m, y_m)).position for x_m, y_m in points))
                yield Leg(length_m(path), path=path)
                yield from self._reach(path[-1], approaches=1)
                (ax, ay), (bx, by) = path[-2:]
                if (ax, ay) != (bx, by) and not self.failure:
                    yield from self._face(math.atan2(by - ay, bx - ax), _FACING_RAD)
            case Sidestep(left_m):
                yield from self._step_aside(start.compose(Pose(0.0, left_m)).position, start.heading_rad)
            case Velocity():
                yield Leg(velocity=movement)
            case _:
                assert_never(movement)

    def _face(self, heading_rad: float, aligned_rad: float) -> Iterator[Leg]:
        """Turn to an absolute heading, unless the difference is small."""
        error_rad = turn_error_rad(heading_rad, self._pose.heading_rad)
        if abs(error_rad) > max(aligned_rad, self._least_turn_rad):
            yield Leg(error_rad, heading_rad, turns=True, tolerance_rad=0.2 * aligned_rad)

    def _straight(self, distance_m: float, heading_rad: float) -> Leg:
        pose = self._pose
        end = pose.x_m + distance_m * math.cos(heading_rad), pose.y_m + distance_m * math.sin(heading_rad)
        return Leg(distance_m, heading_rad, target=end)

    def _reach(self, point: tuple[float, float], approaches: int = 0) -> Iterator[Leg]:
        """Turn towards a point and drive to it, again and again until it is reached or the corrections are used up.

        Args:
            point: the point.
            approaches: straight legs to the point so far.
        """
        turns = 0
        while self._away_m(point) >= self._arrived_m and approaches <= _CORRECTIONS:
            leg = self._leg_to(point, is_correction=approaches > 0, may_turn=turns < _TURNS)
            approaches, turns = (approaches, turns + 1) if leg.turns else (approaches + 1, 0)
            yield leg
        self._require_arrival(point)

    def _step_aside(self, point: tuple[float, float], heading_rad: float) -> Iterator[Leg]:
        """Move sideways to a point, then correct along the axis with the larger error, and face the heading."""
        for _ in range(_CORRECTIONS + 1):
            if self._away_m(point) < self._arrived_m:
                break
            off = Pose(*point).relative_to(Pose(*self._pose.position, heading_rad))
            is_lateral = abs(off.y_m) >= abs(off.x_m)
            yield Leg(off.y_m if is_lateral else off.x_m, heading_rad, target=point, is_lateral=is_lateral)
        self._require_arrival(point)
        if not self.failure:
            yield from self._face(heading_rad, _FACED_RAD)

    def _require_arrival(self, point: tuple[float, float]) -> None:
        if (off_m := self._away_m(point)) > self._missed_m:
            self.failure = f"ended {off_m * 1000:.0f} mm from the requested point, after {_CORRECTIONS} corrections"

    def _away_m(self, point: tuple[float, float]) -> float:
        return math.hypot(point[0] - self._pose.x_m, point[1] - self._pose.y_m)

    def _leg_to(self, point: tuple[float, float], *, is_correction: bool, may_turn: bool) -> Leg:
        """Return a turn towards a point, or a straight leg to it; a small remainder behind the robot is reversed."""
        pose, distance_m = self._pose, self._away_m(point)
        bearing_rad = math.atan2(point[1] - pose.y_m, point[0] - pose.x_m)
        error_rad = turn_error_rad(bearing_rad, pose.heading_rad)
        sign = 1.0
        is_short = is_correction and distance_m < _SHORT_M
        if is_short and abs(error_rad) > math.pi / 2:
            sign, error_rad = -1.0, turn_error_rad(bearing_rad + math.pi, pose.heading_rad)
        # The heading matters only as far as it moves the end of the leg.
        aligned_rad = math.asin(min(0.5 * self._arrived_m / distance_m, 1.0)) if is_short else _ALIGNED_RAD
        aligned_rad = max(aligned_rad, self._least_turn_rad)
        if may_turn and abs(error_rad) > aligned_rad:
            return Leg(error_rad, pose.heading_rad + error_rad, turns=True, tolerance_rad=aligned_rad)
        way_m = distance_m * math.cos(error_rad) if is_short else distance_m
        return Leg(sign * way_m, pose.heading_rad + (0.0 if is_short else error_rad), target=point)


def refusal(movement: Drive, settings: MotionSettings) -> str:
    """Return why a base cannot execute a movement, or an empty string."""
    if movement.goes_sideways and not settings.lateral_m_s:
        return "the base cannot move sideways: its profile has no base.max_lateral_m_s"
    return ""


def length_m(points: Sequence[tuple[float, float]]) -> float:
    """Return the length of a polyline."""
    return sum(math.dist(a, b) for a, b in pairwise(points))


def longest_duration_s(movement: Drive, settings: MotionSettings) -> float:
    """Return a time in which a movement ends, done or failed; each leg has its own limit below it."""
    match movement:
        case Velocity():
            return movement.duration_s + settings.timeout_s
        case Move(distance_m, turn_rad, holds_heading=True):
            ideal_s = ideal_duration_s(abs(distance_m), settings, turns=False)
            return ideal_s + ideal_duration_s(abs(turn_rad), settings, turns=True) + settings.timeout_s
        case Move(distance_m, turn_rad):
            way_m, turned_rad, legs = abs(distance_m), abs(turn_rad), 2
        case Waypoint(x_m, y_m):
            way_m, turned_rad, legs = math.hypot(x_m, y_m), math.tau, 3
        case Sidestep(left_m):
            slower = settings.linear_m_s / settings.lateral_m_s if settings.lateral_m_s else 1.0
            way_m, turned_rad, legs = abs(left_m) * slower, 0.0, 3
        case Trajectory(points):
            way_m, turned_rad, legs = movement.length_m, math.pi * (len(points) + 1), 2
        case _:
            assert_never(movement)
    return 2 * way_m / settings.linear_m_s + 2 * turned_rad / settings.angular_rad_s + legs * settings.timeout_s


def controller_of(
    leg: Leg,
    start: Pose,
    end_rad: float,
    settings: MotionSettings,
    noise: StandstillNoise = QUIET,
    start_error: float = 0.0,
    response: BaseResponse | None = None,
) -> Controller:
    """Return the controller of a leg from odometry `start` to the heading of `Leg.end_rad`; see `MotionController`.

    The settings are those of the robot, and `start_error` is the standard error of `start` along the leg.
    """
    if not leg.holds_heading:
        settings = settings.model_copy(update={"stall_s": DRIVE_SHARE * settings.stall_s})
    if leg.velocity is not None:
        return VelocityController(leg.velocity, start, settings, noise)
    if leg.path:
        return PathController(leg.path, settings, noise, response)
    settings = leg.settings(settings)
    return MotionController(leg, start, end_rad, settings, noise, 0.0 if leg.target else start_error, response)
