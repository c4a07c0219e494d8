"""Turns a base on the spot, or moves it to the side, by velocities, and records its odometry; it is at rest then."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.law import ideal_duration_s
from vsnbench.control.settings import MotionSettings
from vsnbench.errors import RobotError
from vsnbench.robots.checkup.response import CommandedTurn, lateral_results, response_results
from vsnbench.robots.checkup.result import CheckResult
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.values.movement import Move
from vsnbench.values.robot_profile import RobotProfile

_PERIOD_S = 0.02
_TURN_RAD_S, _TURN_S = 0.3, 1.0
_STAIRS_RAD_S = (0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.18, 0.25)
_STAIR_S, _STAIR_READINGS = 0.5, 8
"""Shortest time of a stage, and the number of readings that it should have."""
_ASIDE_M_S, _ASIDE_S = 0.2, 1.5
_ASIDE_STAIRS_M_S = (0.02, 0.04, 0.06, 0.09, 0.12)
_REST_S = 0.8
_SILENT_S = 1.0
_LAST_COMMANDS = 3
"""Number of final zero velocities: a network may lose one."""


class SteeredBase(ABC):
    """A base that this process steers for a check-up."""

    @property
    @abstractmethod
    def now_s(self) -> float:
        """Time on the clock of the arrivals of `latest`."""

    @abstractmethod
    def steer(self, command: Command) -> None:
        """Command a velocity."""

    @abstractmethod
    def latest(self) -> Sequence[OdometryReading]:
        """Return the newest readings of the odometry, oldest first."""

    @abstractmethod
    def hazard(self) -> str:
        """Return the active hazard sensors, or an empty string."""


def motion_response_results(base: SteeredBase, profile: RobotProfile) -> Iterator[CheckResult]:
    """Turn to the left at one velocity and back in stages; report the response of the base.

    A base that can move sideways then does so, which needs 0.3 m of space to its left.

    Raises:
        RobotError: a hazard sensor is active, or the odometry is silent.
    """
    slowest, fastest = profile.base.min_angular_rad_s, min(profile.speeds.angular_rad_s, profile.base.max_angular_rad_s)
    stair_s = max(_STAIR_S, _STAIR_READINGS / profile.base.odometry_rate_hz)
    turn = record_turn(base, [(max(min(_TURN_RAD_S, fastest), slowest), _TURN_S)])
    tried = sorted({max(velocity, slowest) for velocity in _STAIRS_RAD_S if velocity <= fastest})
    stairs = record_turn(base, [(-velocity, stair_s) for velocity in tried])
    yield from response_results(profile, turn, stairs)
    if profile.base.max_lateral_m_s:
        yield from _lateral_response_results(base, profile)


def _lateral_response_results(base: SteeredBase, profile: RobotProfile) -> Iterator[CheckResult]:
    """Move to the left at one velocity and back in stages; report the response of the base."""
    slowest, fastest = profile.base.min_lateral_m_s, min(profile.speeds.linear_m_s, profile.base.max_lateral_m_s)
    stair_s = max(_STAIR_S, _STAIR_READINGS / profile.base.odometry_rate_hz)
    way = record_turn(base, [(max(min(_ASIDE_M_S, fastest), slowest), _ASIDE_S)], is_lateral=True)
    tried = sorted({max(velocity, slowest) for velocity in (slowest, *_ASIDE_STAIRS_M_S) if 0 < velocity <= fastest})
    stairs = record_turn(base, [(-velocity, stair_s) for velocity in tried], is_lateral=True)
    yield from lateral_results(profile, way, stairs)


def record_turn(base: SteeredBase, stages: Sequence[tuple[float, float]], *, is_lateral: bool = False) -> CommandedTurn:
    """Turn a base through stages of velocity (rad/s) and duration (s), and let it come to rest.

    A lateral "turn" is a way to the side, with velocities to the left in m/s.

    Raises:
        RobotError: a hazard sensor is active, or the odometry is silent.
    """
    commands: list[tuple[float, float]] = []
    readings: dict[float, OdometryReading] = {}
    began_s = base.now_s
    try:
        for velocity, lasting_s in (*stages, (0.0, _REST_S)):
            until_s = base.now_s + lasting_s
            while base.now_s < until_s:
                _check(base, readings, began_s)
                commands.append((base.now_s, velocity))
                base.steer(Command(lateral_m_s=velocity) if is_lateral else Command(angular_rad_s=velocity))
                time.sleep(_PERIOD_S)
                readings |= {reading.stamp_s: reading for reading in base.latest()}
    finally:
        for _ in range(_LAST_COMMANDS):
            base.steer(STANDSTILL)
            time.sleep(_PERIOD_S)
    return CommandedTurn(tuple(commands), tuple(readings[stamp_s] for stamp_s in sorted(readings)), is_lateral)


def _check(base: SteeredBase, readings: dict[float, OdometryReading], began_s: float) -> None:
    if hazard := base.hazard():
        raise RobotError(f"{hazard} while the base turned", advice="free the robot first", code="hazard")
    heard_s = max((reading.arrival_s for reading in list(readings.values())[-3:]), default=began_s)
    if base.now_s - heard_s > _SILENT_S:
        raise RobotError("the odometry is silent", advice="start the driver of the base", code="no-odometry")


def turn_timeout_s(movement: Move, profile: RobotProfile) -> float:
    """Return the time in which a mover has to answer to a turn: a slow base turns for longer than most."""
    settings = MotionSettings.for_robot(profile)
    return 2 * ideal_duration_s(abs(movement.turn_rad), settings, turns=True) + 12.0
