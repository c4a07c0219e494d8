"""Response of a base to commands: dead time, motor lag, slowest velocities; commanded motion not yet measured."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.values.pose import Pose

_STEP_S = 0.005
_DEAD_TIMES_S = np.arange(0.0, 0.42, 0.03)
_FINE_DEAD_TIMES_S = np.arange(-0.03, 0.031, 0.005)
_LAGS_S = np.concatenate([np.arange(0.0, 0.1, 0.01), np.arange(0.1, 0.2, 0.02), np.arange(0.2, 0.41, 0.04)])
_FEWEST_READINGS = 8
_LEAST_M, _LEAST_RAD = 0.05, math.radians(8)
"""Shorter movements do not show the response."""
_WORST_FIT = 0.03
"""Largest deviation of a fit, as a share of the movement: more is a base that slipped, was blocked or was pushed."""
_REMEMBERED = 5
_GAINS = 0.3, 2.5
"""Smallest and largest gain of a base that still follows its commands."""
_LINEAR_GAINS = 0.8, 1.25
"""Limits for forward and lateral commands: a wrong gain must not drive a robot much faster than its profile says."""
_LEAST_GAIN_ERROR = 0.04
"""Smaller differences are slip, which feedback corrects."""


@dataclass(frozen=True, slots=True)
class BaseResponse:
    """What a base makes of a command: nothing for the dead time, then an exponential approach with the lag.

    A command below the slowest velocity does not move the base. The gains are what a base makes of a velocity, as a
    share of it: the driver of a base with skidding wheels may use the track of another floor.
    """

    dead_time_s: float = 0.0
    lag_s: float = 0.0
    linear_gain: float = 1.0
    angular_gain: float = 1.0
    slowest_m_s: float = 0.0
    slowest_rad_s: float = 0.0
    lateral_gain: float = 1.0
    slowest_lateral_m_s: float = 0.0

    @property
    def sideways(self) -> "BaseResponse":
        """The response of a base that faces left: its forward motion is the lateral motion of this one."""
        return replace(self, linear_gain=self.lateral_gain, slowest_m_s=self.slowest_lateral_m_s)

    @property
    def delay_s(self) -> float:
        """Delay of a base at constant velocity."""
        return self.dead_time_s + self.lag_s

    def scaled(self, wanted: Command) -> Command:
        """Return the command of which the base makes the wanted velocity."""
        if self.linear_gain == self.angular_gain == self.lateral_gain == 1:
            return wanted
        return Command(
            wanted.linear_m_s / self.linear_gain,
            wanted.angular_rad_s / self.angular_gain,
            wanted.lateral_m_s / self.lateral_gain,
        )


class _Sent(NamedTuple):
    """A command and its time; a tuple for speed, since every simulated period makes several."""

    at_s: float
    command: Command


class SentCommands:
    """The commands of a movement, and what they still cause after the newest odometry.

    Attributes:
        dead_time_s: delay of the odometry behind the commands, without the motor lag.
        lag_s: time constant of the motors.
    """

    def __init__(self, response: BaseResponse) -> None:
        self.dead_time_s = response.dead_time_s
        self.lag_s = response.lag_s
        self._sent: deque[_Sent] = deque()
        self._moving, self._moving_s = STANDSTILL, -math.inf

    @property
    def last(self) -> Command:
        """Newest command; standstill before the first."""
        return self._sent[-1].command if self._sent else STANDSTILL

    def add(self, at_s: float, command: Command) -> None:
        """Add a command."""
        self._sent.append(_Sent(at_s, command))

    def pending(self, now_s: float, stamp_s: float) -> tuple[float, float]:
        """Return the motion commanded since the odometry was measured: metres and radians, not velocities."""
        since_s = stamp_s - self.dead_time_s
        if self.lag_s:
            self._follow(since_s)
        while len(self._sent) > 1 and self._sent[1].at_s <= since_s:
            self._sent.popleft()
        linear_m = angular_rad = 0.0
        until_s = now_s
        for at_s, command in reversed(self._sent):
            lasted_s = until_s - (at_s if at_s > since_s else since_s)
            if lasted_s <= 0.0:
                lasted_s = 0.0  # a comparison costs a third of a call of max, and this runs every period
            linear_m += command.linear_m_s * lasted_s
            angular_rad += command.angular_rad_s * lasted_s
            until_s = at_s
        if self.lag_s:
            linear_m += self.lag_s * self._moving.linear_m_s
            angular_rad += self.lag_s * self._moving.angular_rad_s
        return linear_m, angular_rad

    def _follow(self, until_s: float) -> None:
        """Advance the modelled velocity of the base to a time of the commands."""
        for k, (at_s, command) in enumerate(self._sent):
            ends_s = self._sent[k + 1].at_s if k + 1 < len(self._sent) else math.inf
            begins_s, ends_s = max(at_s, self._moving_s), min(ends_s, until_s)
            if ends_s <= begins_s:
                continue
            kept = math.exp((begins_s - ends_s) / self.lag_s)
            moving = self._moving
            self._moving = Command(
                command.linear_m_s + kept * (moving.linear_m_s - command.linear_m_s),
                command.angular_rad_s + kept * (moving.angular_rad_s - command.angular_rad_s),
            )
            self._moving_s = ends_s


class ResponseMeter:
    """Measures the response of a base from its movements."""

    def __init__(self) -> None:
        self._measured: deque[BaseResponse] = deque(maxlen=_REMEMBERED)
        self._linear_gain = self._angular_gain = self._lateral_gain = 1.0
        self._slowest_m_s = self._slowest_rad_s = self._slowest_lateral_m_s = 0.0

    @property
    def response(self) -> BaseResponse | None:
        """Median of the latest measurements; None before the first."""
        if not self._measured:
            return None
        return BaseResponse(
            median(r.dead_time_s for r in self._measured),
            median(r.lag_s for r in self._measured),
            self._linear_gain,
            self._angular_gain,
            self._slowest_m_s,
            self._slowest_rad_s,
            self._lateral_gain,
            self._slowest_lateral_m_s,
        )

    def add(
        self,
        slowest: float,
        start: Pose,
        commands: Sequence[tuple[float, Command]],
        readings: Sequence[tuple[float, Pose]],
        *,
        turns: bool,
        is_lateral: bool = False,
    ) -> None:
        """Add a turn or a straight move that ended by itself; one that was short or does not fit shows no delay.

        Args:
            slowest: slowest velocity that moves the base, as far as it showed; m/s or rad/s.
            start: odometry at its start.
            commands: time and velocity of each command, the last one zero.
            readings: time of measurement and odometry, on the same clock.
            turns: whether it was a turn.
            is_lateral: whether it was a move to the side.
        """
        if is_lateral:
            start = Pose(start.x_m, start.y_m, start.heading_rad + math.pi / 2)
            commands = [(at_s, Command(sent.lateral_m_s, sent.angular_rad_s)) for at_s, sent in commands]
        velocities = [(at_s, sent.angular_rad_s if turns else sent.linear_m_s) for at_s, sent in commands]
        covered = [(at_s, _covered(start, pose, turns=turns)) for at_s, pose in readings]
        response = measured_response(velocities, covered, _LEAST_RAD if turns else _LEAST_M)
        if response is not None:
            self._measured.append(response)
            if turns:
                self._angular_gain = _settled_gain(self._angular_gain, response.angular_gain)
            elif is_lateral:
                self._lateral_gain = _bounded(_settled_gain(self._lateral_gain, response.linear_gain))
            else:
                self._linear_gain = _bounded(_settled_gain(self._linear_gain, response.linear_gain))
        if turns:
            self._slowest_rad_s = max(self._slowest_rad_s, slowest)
        elif is_lateral:
            self._slowest_lateral_m_s = max(self._slowest_lateral_m_s, slowest)
        else:
            self._slowest_m_s = max(self._slowest_m_s, slowest)


def _bounded(gain: float) -> float:
    return min(max(gain, _LINEAR_GAINS[0]), _LINEAR_GAINS[1])


def _covered(start: Pose, pose: Pose, *, turns: bool) -> float:
    """Return the turn, or the distance ahead in the direction of `start`, from one pose to another."""
    if turns:
        return pose.heading_rad - start.heading_rad
    x_m, y_m = pose.x_m - start.x_m, pose.y_m - start.y_m
    return x_m * math.cos(start.heading_rad) + y_m * math.sin(start.heading_rad)


def measured_response(
    commands: Sequence[tuple[float, float]], readings: Sequence[tuple[float, float]], least: float
) -> BaseResponse | None:
    """Return the dead time and lag that explain a movement best; None if none does.

    Args:
        commands: time and velocity of each command, the last one zero.
        readings: time of measurement and amount covered since the start.
        least: smallest amount that shows a response.

    Returns:
        The response; both gains are that of the movement.
    """
    if len(readings) < _FEWEST_READINGS or len(commands) < 2:
        return None
    at_s, covered = np.array([t for t, _ in readings]), np.array([way for _, way in readings])
    extent = float(covered.max() - covered.min())
    if extent < least:
        return None
    times_s, velocities = np.array([t for t, _ in commands]), np.array([v for _, v in commands])
    if at_s[-1] <= times_s[0]:  # by its stamps, the base measured nothing since the first command
        return None
    grid_s = np.arange(times_s[0] - _DEAD_TIMES_S[-1] - _STEP_S, at_s[-1] + _STEP_S, _STEP_S)
    index = np.searchsorted(times_s, grid_s, side="right") - 1
    commanded = np.where(index >= 0, velocities[np.maximum(index, 0)], 0.0)
    best, best_error = BaseResponse(), math.inf
    for lag_s in _LAGS_S:
        way = np.cumsum(_lagged(commanded, lag_s)) * _STEP_S

        def modelled(dead_time_s: float, way: npt.NDArray[np.float64] = way) -> npt.NDArray[np.float64]:
            return np.interp(at_s - dead_time_s, grid_s + _STEP_S, way)

        def misfit(dead_time_s: float, way: npt.NDArray[np.float64] = way) -> float:
            return _misfit(modelled(dead_time_s, way), covered)

        coarse_s = min(_DEAD_TIMES_S, key=misfit)
        dead_time_s = min(np.maximum(coarse_s + _FINE_DEAD_TIMES_S, 0.0), key=misfit)
        if (error := misfit(dead_time_s)) < best_error:
            gain = _gain(modelled(dead_time_s), covered)
            best, best_error = BaseResponse(float(dead_time_s), float(lag_s), gain, gain), error
    return best if best_error <= _WORST_FIT * extent else None


def _lagged(commanded: npt.NDArray[np.float64], lag_s: float) -> npt.NDArray[np.float64]:
    """Return the velocity of a base with a first-order lag, on the same grid."""
    if lag_s == 0:
        return commanded
    taps = np.exp(-np.arange(0.0, 8 * lag_s, _STEP_S) / lag_s)
    return np.convolve(commanded, taps / taps.sum())[: len(commanded)]


def _settled_gain(known: float, measured: float) -> float:
    """Return the new gain of an axis from a movement whose commands used the known one."""
    gain = known * measured if abs(measured - 1) > _LEAST_GAIN_ERROR else known
    return gain if abs(gain - 1) > _LEAST_GAIN_ERROR else 1.0


def _gain(modelled: npt.NDArray[np.float64], covered: npt.NDArray[np.float64]) -> float:
    """Return the gain with which a model explains what was covered best."""
    gain = float(modelled @ covered) / max(float(modelled @ modelled), 1e-12)
    return min(max(gain, _GAINS[0]), _GAINS[1])


def _misfit(modelled: npt.NDArray[np.float64], covered: npt.NDArray[np.float64]) -> float:
    """Return the root mean square of what a model leaves, with the best gain."""
    return float(np.sqrt(np.mean((covered - _gain(modelled, covered) * modelled) ** 2)))
