"""Checks of what a base can do, by its response to commanded turns and ways to the side; pure."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vsnbench.control.response import BaseResponse, measured_response
from vsnbench.control.settings import MotionSettings
from vsnbench.control.standstill import BOUND_ERRORS
from vsnbench.robots.checkup.odometry import smallest_allowed, tolerances_line
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.sensing.odometry.odometry import ClockOffset, OdometryReading
from vsnbench.values.robot_profile import RobotProfile

_LEAST_RAD, _LEAST_M = math.radians(8), 0.05
"""Smallest turn, and smallest way to the side, that show the response of a base."""
_LONGEST_DELAY_S = 0.5
"""A base with a longer delay is taken for one that does not follow its commands."""
_FOLLOWED_SHARE = 0.5
"""A base follows a velocity if it turns with at least this share of it."""
_LOW_RATE = 0.8
_DEAD_TIME_S = 0.05
"""Largest difference between the dead time of the profile and that of the base."""
_FEWEST = 4


@dataclass(frozen=True, slots=True)
class CommandedTurn:
    """Commands of turns on the spot, or of ways to the side, and the odometry meanwhile.

    Attributes:
        commands: time on the clock of this process and velocity (rad/s, or m/s to the left) of each command; the last
            one is zero.
        readings: odometry from before the first command until the base is at rest again.
        is_lateral: whether the base was commanded to the side.
    """

    commands: tuple[tuple[float, float], ...]
    readings: tuple[OdometryReading, ...]
    is_lateral: bool = False

    @property
    def covered(self) -> list[tuple[float, float]]:
        """Time of measurement on the clock of this process, and what was covered until each reading.

        It is the heading in radians, unwrapped, or the way to the left of the first reading in metres.
        """
        clock = ClockOffset()
        for reading in self.readings:
            clock.add(reading.stamp_s, reading.arrival_s)
        if self.is_lateral:
            amounts = [reading.pose.relative_to(self.readings[0].pose).y_m for reading in self.readings]
        else:
            amounts = list(map(float, np.unwrap([reading.pose.heading_rad for reading in self.readings])))
        return [
            (clock.to_local(reading.stamp_s), amount) for reading, amount in zip(self.readings, amounts, strict=True)
        ]


def response_of(turn: CommandedTurn) -> BaseResponse | None:
    """Return the dead time, motor lag and gain of a base; None if the turn does not fit its commands."""
    amounts = turn.covered
    covered = [(at_s, amount - amounts[0][1]) for at_s, amount in amounts]
    return measured_response(turn.commands, covered, _LEAST_M if turn.is_lateral else _LEAST_RAD)


def rate_of_new_values(turn: CommandedTurn) -> float:
    """Return how often the heading changed per second while the base turned; 0 if it hardly changed.

    A driver that repeats its last value sends more messages than it measures.
    """
    changes = [at_s for (_, before), (at_s, after) in pairwise(turn.covered) if after != before]
    moving = [at_s for at_s in changes if turn.commands[0][0] < at_s <= turn.commands[-1][0]]
    return (len(moving) - 1) / (moving[-1] - moving[0]) if len(moving) > _FEWEST else 0.0


def slowest_turn(stairs: CommandedTurn, delay_s: float) -> float | None:
    """Return the slowest commanded velocity that the base followed, with all faster ones; None for none.

    Args:
        stairs: turn in stages, each with one velocity.
        delay_s: delay of the odometry behind the commands.
    """
    slowest = None
    for begin_s, end_s, velocity in reversed(_stages(stairs.commands)):
        window = [(t, rad) for t, rad in stairs.covered if begin_s + delay_s < t <= end_s + delay_s]
        if len(window) < _FEWEST or not _follows(window, velocity):
            break
        slowest = abs(velocity)
    return slowest


def response_results(profile: RobotProfile, turn: CommandedTurn, stairs: CommandedTurn) -> Iterator[CheckResult]:
    """Report the rate of new odometry, the response and the slowest turn, with what the profile should state.

    Args:
        profile: profile of the robot.
        turn: turn with one velocity.
        stairs: turn in stages of rising velocity.
    """
    wanted_hz = profile.base.odometry_rate_hz
    rate_hz = rate_of_new_values(turn)
    if 0 < rate_hz < _LOW_RATE * wanted_hz:
        seen = f"{rate_hz:.1f} new values per second; the profile has {wanted_hz:g} Hz"
        advice = f"put the measured rate into the profile: base: {{odometry_rate_hz: {max(round(rate_hz), 1)}}}"
        yield CheckResult("odometry rate", Health.WARNING, seen, advice)
    response = response_of(turn)
    if response is None:
        advice = "check for slipping wheels, and that no other node steers; movements will need corrections"
        yield CheckResult("response", Health.WARNING, "the turn does not fit its commands", advice)
    else:
        yield _delay_result(profile, response)
    yield _slowest_result(profile, slowest_turn(stairs, 0.0 if response is None else response.delay_s), stairs)


def lateral_results(profile: RobotProfile, way: CommandedTurn, stairs: CommandedTurn) -> Iterator[CheckResult]:
    """Report the response to commands to the side, with what the profile should state.

    Args:
        profile: profile of the robot.
        way: way to the side with one velocity.
        stairs: way in stages of rising velocity.
    """
    response = response_of(way)
    if response is None:
        moved_m = way.covered[-1][1] - way.covered[0][1]
        seen = f"the way to the side does not fit its commands: the odometry moved {moved_m * 100:.0f} cm to the left"
        advice = "if the base did not move sideways, remove base.max_lateral_m_s from the profile"
        yield CheckResult("sideways", Health.WARNING, seen, advice)
        return
    delays = f"dead time {response.dead_time_s * 1000:.0f} ms, motor lag {response.lag_s * 1000:.0f} ms"
    seen = f"{delays}, {response.linear_gain:.2f} m per commanded metre"
    slowest_m_s, stated_m_s = slowest_turn(stairs, response.delay_s), profile.base.min_lateral_m_s
    if slowest_m_s is None:
        fastest = max(abs(velocity) for _, velocity in stairs.commands)
        seen = f"{seen}; the base follows nothing up to {fastest:g} m/s to the right"
        yield CheckResult("sideways", Health.WARNING, seen, "check that nothing blocks it, and doctor --move again")
    elif 0 < stated_m_s < slowest_m_s:
        seen = f"{seen}; it follows {slowest_m_s:g} m/s, nothing slower; base.min_lateral_m_s is {stated_m_s:g}"
        advice = f"put the slowest velocity into the profile: base: {{min_lateral_m_s: {slowest_m_s:g}}}"
        yield CheckResult("sideways", Health.WARNING, seen, advice)
    else:
        yield CheckResult("sideways", Health.OK, f"{seen}; it follows {slowest_m_s:g} m/s")


def _delay_result(profile: RobotProfile, response: BaseResponse) -> CheckResult:
    seen = f"dead time {response.dead_time_s * 1000:.0f} ms, motor lag {response.lag_s * 1000:.0f} ms"
    stated_s = profile.base.dead_time_s
    if stated_s is not None and abs(stated_s - response.dead_time_s) > _DEAD_TIME_S:
        advice = f"put the measured dead time into the profile: base: {{dead_time_s: {response.dead_time_s:.2f}}}"
        return CheckResult("response", Health.WARNING, f"{seen}; the profile has {stated_s * 1000:.0f} ms", advice)
    if response.delay_s <= _LONGEST_DELAY_S:
        return CheckResult("response", Health.OK, seen)
    seen = f"{seen}: movements of a base with more than {_LONGEST_DELAY_S:g} s end as not followed"
    advice = f"run the control loop next to the base: vsnbench robots serve {profile.argument}"
    return CheckResult("response", Health.FAILED, seen, advice)


def _slowest_result(profile: RobotProfile, slowest_rad_s: float | None, stairs: CommandedTurn) -> CheckResult:
    settings, stated_rad_s = MotionSettings.for_robot(profile), profile.base.min_angular_rad_s
    if slowest_rad_s is None:
        fastest = max(abs(velocity) for _, velocity in stairs.commands)
        seen = f"the base follows no turn up to {fastest:g} rad/s"
        advice = "check that it is off its dock, and its motors are on; a deadband in its driver must be lower"
        return CheckResult("slowest turn", Health.FAILED, seen, advice)
    # A correction lasts at least one control period, and can leave half of what the base turns in it.
    left_rad, tolerance_rad = 0.5 * slowest_rad_s * settings.control_period_s, settings.tolerance(turns=True)
    seen = f"the base follows {slowest_rad_s:g} rad/s"
    if 0 < stated_rad_s < slowest_rad_s:
        seen = f"{seen}, nothing slower; base.min_angular_rad_s is {stated_rad_s:g}"
        advice = f"put the slowest turn into the profile: base: {{min_angular_rad_s: {slowest_rad_s:g}}}"
        return CheckResult("slowest turn", Health.WARNING, seen, advice)
    if left_rad <= tolerance_rad:
        return CheckResult("slowest turn", Health.OK, seen)
    seen = f"{seen}, nothing slower: corrections can leave {math.degrees(left_rad):.2g}°, more than the tolerance"
    turn_deg = smallest_allowed(lambda deg: math.radians(deg) >= left_rad, 10.0)
    lines = tolerances_line(settings.position_tolerance_m, turn_deg)
    advice = f"lower the deadband in the driver of the base, or {lines}"
    return CheckResult("slowest turn", Health.WARNING, seen, advice)


def _stages(commands: Sequence[tuple[float, float]]) -> list[tuple[float, float, float]]:
    """Return begin, end and velocity of each stage but standstill, in order."""
    stages: list[tuple[float, float, float]] = []
    for (at_s, velocity), (next_s, _) in pairwise(commands):
        if stages and stages[-1][2] == velocity:
            stages[-1] = (stages[-1][0], next_s, velocity)
        elif velocity:
            stages.append((at_s, next_s, velocity))
    return stages


def _follows(window: Sequence[tuple[float, float]], velocity: float) -> bool:
    """Return whether readings turn with a velocity, beyond their noise."""
    times_s, headings_rad = np.array([t for t, _ in window]), np.array([rad for _, rad in window])
    times_s = times_s - times_s.mean()
    squares = float(times_s @ times_s)
    slope = float(times_s @ headings_rad) / squares
    rest = headings_rad - headings_rad.mean() - slope * times_s
    error = math.sqrt(float(rest @ rest) / (len(window) - 2) / squares)
    return slope * math.copysign(1, velocity) > max(_FOLLOWED_SHARE * abs(velocity), BOUND_ERRORS * error)
