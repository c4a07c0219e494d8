"""State machine of a turn or a straight move: drive the profile, settle, measure, correct, or fail with a reason."""

import math
from enum import StrEnum
from typing import NamedTuple

from vsnbench.control.command import STANDSTILL, Command, Controller, MotionStatus
from vsnbench.control.correction import COARSE, Correction
from vsnbench.control.law import (
    acceleration,
    braking_speed,
    ideal_duration_s,
    speed,
    straight_error_m,
    turn_error_rad,
)
from vsnbench.control.leg import Leg
from vsnbench.control.response import BaseResponse, SentCommands
from vsnbench.control.settings import MotionSettings
from vsnbench.control.slowest import SlowestVelocity
from vsnbench.control.stall import StallMonitor
from vsnbench.control.standstill import QUIET, STILL_SHARE, RemainingFilter, RestWindow, StandstillNoise, is_quiet
from vsnbench.values.pose import Pose, wrap_angle

_LEARNING_SHARES = (0.1, 0.6)
"""Part of the distance on which the dead time is measured: after standing still, before braking."""
_STALE_SHARE = 0.5
"""Maximum age of odometry for the stall test, as a share of the stall time."""
_MAX_LATENCY_S = 0.5
"""Maximum dead time; a larger lag is a base that does not follow its commands."""
_HOMING_M = 0.15
"""Nearer than this, the direction to a target is not accurate enough to steer by."""


class _Phase(StrEnum):
    DRIVE = "drive"
    SETTLE = "settle"
    CORRECT = "correct"


# A module constant costs half of an attribute of an enum, and every period reads several.
_MOVING = MotionStatus.MOVING
_DRIVE, _SETTLE, _CORRECT = _Phase.DRIVE, _Phase.SETTLE, _Phase.CORRECT


class _Mark(NamedTuple):
    """Distance covered or commanded at a time."""

    at_s: float
    amount: float


class MotionController(Controller):
    """One turn, or one straight move, from start to end; it has no clock and no robot.

    Call `step` with the newest odometry about every `settings.control_period_s`, send the returned command to the base,
    and stop when `status` is no longer MOVING. Motion commanded since the odometry was measured is added to it, at any
    odometry rate. If the `response` is not known, the dead time between a command and its effect in the odometry is
    measured during acceleration. The result is judged only at rest; a small remaining error is corrected by dead
    reckoning.

    A turn goes to the absolute `target_heading_rad`; a straight move holds this heading, or steers to its target. A
    lateral move is the straight move of a robot that faces left, without steering.

    Args:
        leg: a turn or a straight leg.
        start: odometry at the start; a mean of readings if they are noisy.
        target_heading_rad: absolute heading.
        settings: speeds, limits and tolerances.
        noise: noise of the odometry at rest; above a small share of the tolerance the remaining distance is filtered,
            and `RestWindow` judges the result.
        start_error: standard error of `start` along the motion.
        response: response of the base, measured in earlier movements; None if it is not known.
    """

    def __init__(
        self,
        leg: Leg,
        start: Pose,
        target_heading_rad: float,
        settings: MotionSettings,
        noise: StandstillNoise = QUIET,
        start_error: float = 0.0,
        response: BaseResponse | None = None,
    ) -> None:
        super().__init__()
        self._is_lateral = leg.is_lateral
        if leg.is_lateral:
            start, target_heading_rad = _facing_left(start), target_heading_rad + math.pi / 2
        self.settings = settings
        self._start = start
        self._target_heading_rad = target_heading_rad
        self._phase = _DRIVE
        self._began_s: float | None = None
        self._last_s = 0.0
        self._last_heading_rad = start.heading_rad
        self._turned_rad = 0.0
        self._speed = 0.0
        self._commanded = 0.0
        self._knows_response = response is not None
        response = response or BaseResponse(settings.latency_s)
        if leg.is_lateral:
            response = response.sideways
        self._sent = SentCommands(response)
        self._target = leg.target
        self._still_since: _Mark | None = None
        self._commands: list[_Mark] = []
        self._window: RestWindow | None = None
        self._rolled_s = -math.inf
        self._smoothing: RemainingFilter | None = None
        self._way = abs(leg.way)
        self._sign = 1 if leg.way > 0 else -1
        self._turns = turns = leg.turns
        self._left = self._way
        self._cruise = settings.cruise(turns=turns)
        self._limit_s = ideal_duration_s(self._way, settings, turns=turns) + settings.timeout_s
        self._period_s = settings.control_period_s
        self._stall_s = settings.stall_s
        self._tolerance = settings.tolerance(turns=turns)
        self._stall = StallMonitor(settings.stall_s, COARSE * self._tolerance)
        self._odometry_timeout_s = settings.odometry_timeout_s
        self._acceleration = acceleration(self._cruise, self._way, settings.acceleration_share)
        self._deceleration = acceleration(self._cruise, self._way, settings.deceleration_share)
        slowest_rad_s = max(response.slowest_rad_s, settings.slowest_rad_s)
        slowest = slowest_rad_s if self._turns else max(response.slowest_m_s, settings.slowest_m_s)
        self._slowest = SlowestVelocity(slowest, self._cruise, self._tolerance, settings)
        self._correction = Correction(self._tolerance, self._slowest, knows_delay=self._knows_response)
        self._slowest_turn = SlowestVelocity(slowest_rad_s, settings.angular_rad_s, math.inf, settings)
        if not is_quiet(spread := noise.along(turns=self._turns), self._tolerance):
            self._window = RestWindow(spread, start_error, self._tolerance)
            self._smoothing = RemainingFilter()
        # The nominal turn plus the deviation from it, because a half turn has no shorter direction.
        nominal_rad = self._sign * self._way
        self._turn_rad = nominal_rad + turn_error_rad(target_heading_rad, start.heading_rad + nominal_rad)

    @property
    def remaining_m(self) -> float:
        """Distance that was left at the last odometry."""
        return 0.0 if self._turns else max(self._left, 0.0)

    @property
    def rest_since_s(self) -> float:
        """Time since when the base has been at rest, if noisy readings were averaged; infinity otherwise."""
        return max(self._window.since_s, self._rolled_s) if self._window is not None else math.inf

    @property
    def slowest(self) -> float:
        """Slowest velocity that moves the base, as far as it is known: m/s of a move, rad/s of a turn."""
        return self._slowest.velocity

    def step(self, pose: Pose, now_s: float, stamp_s: float | None = None) -> Command:
        """Process the newest odometry and return the velocity to command from now on.

        Args:
            pose: the newest odometry, in the frame of the `start` pose.
            now_s: monotonic time of the caller's clock.
            stamp_s: time of measurement of `pose` on the same clock; default: now.
        """
        if self.status is not _MOVING:
            return STANDSTILL
        if self._is_lateral:
            pose = _facing_left(pose)
        if stamp_s is None or stamp_s > now_s:
            stamp_s = now_s
        if self._began_s is None:
            self._began_s, self._last_s = now_s, now_s - self._period_s
        period_s = max(now_s - self._last_s, 0.0)
        self._last_s = now_s
        self.duration_s = now_s - self._began_s
        self._turned_rad += wrap_angle(pose.heading_rad - self._last_heading_rad)
        self._last_heading_rad = pose.heading_rad
        left = self._left = self.error(pose)
        if (sent := self._sent.last) is not STANDSTILL:
            self._commanded += self._along(sent.linear_m_s, sent.angular_rad_s) * period_s
        if self._phase is _DRIVE and not self.corrections and not self._knows_response:
            self._learn_latency(left, now_s, stamp_s)
        if now_s - stamp_s > self._odometry_timeout_s:
            self.sensor_lost = True
            return self.abort(f"no odometry for {now_s - stamp_s:.1f} s")
        if self.duration_s > self._limit_s:
            return self.abort(f"not done after {self.duration_s:.1f} s: {self._shortfall(pose)}")
        if now_s >= self._stall.due_s and self._stalled(left, now_s, stamp_s):
            return self.abort(f"the base does not follow its commands: {self._shortfall(pose)}")
        command = self._next(pose, left, now_s, stamp_s, min(period_s, 5 * self._period_s))
        if self.status is not _MOVING:
            return STANDSTILL
        self._sent.add(now_s, command)
        return command.turned_left if self._is_lateral else command

    def error(self, pose: Pose) -> float:
        """Return the remaining distance at `pose`: metres or radians, positive in the direction of the motion."""
        if self._turns:
            return self._sign * (self._turn_rad - self._turned_rad)
        if self._target is not None:
            x_m, y_m = self._target[0] - pose.x_m, self._target[1] - pose.y_m
            return self._sign * (x_m * math.cos(pose.heading_rad) + y_m * math.sin(pose.heading_rad))
        return straight_error_m(self._way, self._start, pose)

    def _next(self, pose: Pose, left: float, now_s: float, stamp_s: float, period_s: float) -> Command:
        """Return the next command of the phase, or change the phase; `left` is the error at `pose`."""
        if self._phase is _SETTLE:
            if self._window is None and not self._settled(left, now_s, stamp_s):
                return STANDSTILL
            coming = self._along(*self._sent.pending(now_s, stamp_s)) if self._knows_response else 0.0
            if self._window is None:
                self._judge(pose, left - coming, now_s)
            else:
                if abs(coming) > STILL_SHARE * self._tolerance:
                    self._rolled_s = stamp_s
                self._judge_by_window(self._window, pose, left - coming, now_s, stamp_s)
            if self.status is not _MOVING or self._phase is _SETTLE:
                return STANDSTILL
        pending: tuple[float, float] | None = None
        if self._phase is _CORRECT:
            # Counts commands alone: at low speed, late odometry would be misleading.
            remaining = self._correction.amount - self._commanded
        else:
            pending = self._sent.pending(now_s, stamp_s)
            remaining = left - self._along(*pending)
            if self._smoothing is not None:
                remaining = self._smoothing.remaining(remaining, self._commanded, stamp_s)
        way = -1.0 if self._correction.amount < 0 else 1.0  # a correction may go backwards
        slowest = self._slowest
        near = 0.1 * self._tolerance
        if slowest.velocity:
            near = max(near, slowest.least(self._period_s))
        if remaining * way <= near:
            self._phase, self._speed, self._still_since = _SETTLE, 0.0, None
            if self._window is not None:  # a base with a lag continues to roll for longer than the lag
                delay_s = self._sent.dead_time_s + self._sent.lag_s
                self._window.restart(now_s + self.settings.settle_s + 2 * delay_s)
            return STANDSTILL
        faster = speed(self._speed, self._acceleration, (self._speed + self._acceleration * period_s / 2) * period_s)
        slower = braking_speed(remaining * way, self._deceleration, max(period_s, self._period_s))
        self._speed = min(faster, self._cruise, slower)
        # A correction begins at rest.
        if slower <= self._speed and not self.corrections and now_s >= slowest.due_s:
            slowest.look(now_s, left, self._commanded, self._speed, self._delay_s)
        if slowest.velocity:
            self._speed = min(slowest.raised(self._speed, remaining * way, self._period_s), self._cruise)
        if self.corrections:
            self._correction.drives(self._speed)
        signed = self._sign * (way * self._speed)
        if self._turns:
            return Command(angular_rad_s=signed)
        _, turning_rad = pending if pending is not None else self._sent.pending(now_s, stamp_s)
        if self._target is not None and abs(left) > _HOMING_M and not self._is_lateral:
            x_m, y_m = self._target[0] - pose.x_m, self._target[1] - pose.y_m
            self._target_heading_rad = math.atan2(self._sign * y_m, self._sign * x_m)
        turn_rad_s = self._holding_rad_s(pose.heading_rad + turning_rad)
        return Command(signed, self._slowest_turn.in_turns(turn_rad_s, period_s))

    @property
    def _delay_s(self) -> float:
        return self._sent.dead_time_s + self._sent.lag_s

    def _holding_rad_s(self, heading_rad: float) -> float:
        """Return the angular velocity that holds the heading during a move."""
        hold_rad_s = self.settings.heading_gain_per_s * turn_error_rad(self._target_heading_rad, heading_rad)
        limit_rad_s = self.settings.angular_rad_s
        return max(-limit_rad_s, min(hold_rad_s, limit_rad_s))

    def _along(self, linear: float, angular: float) -> float:
        """Return the component of a velocity, or of its integral, in the direction of the motion."""
        return self._sign * (angular if self._turns else linear)

    def _learn_latency(self, left: float, now_s: float, stamp_s: float) -> None:
        """During the first drive, measure the delay between a commanded distance and the same measured distance."""
        self._commands.append(_Mark(now_s, self._commanded))
        way = self._way
        covered = way - left
        if not _LEARNING_SHARES[0] * way <= covered <= min(_LEARNING_SHARES[1] * way, self._commanded):
            return
        while len(self._commands) > 2 and self._commands[1].amount < covered:
            self._commands.pop(0)
        before, after = self._commands[0], self._commands[1]
        share = (covered - before.amount) / max(after.amount - before.amount, 1e-9)
        asked_s = before.at_s + share * (after.at_s - before.at_s)
        self._sent.dead_time_s = min(max(stamp_s - asked_s, 0.0), _MAX_LATENCY_S)

    def _settled(self, left: float, now_s: float, stamp_s: float) -> bool:
        """Return whether the measured pose has not changed for the settling time, and should not change any more."""
        still = self._still_since
        if still is None or abs(left - still.amount) > STILL_SHARE * self._tolerance:
            self._still_since = _Mark(stamp_s, left)
            return False
        if not self._knows_response:
            needed_s = self.settings.settle_s + max(self._sent.dead_time_s, self._correction.extra_delay_s)
            return stamp_s - still.at_s >= needed_s - 1e-9
        if stamp_s - still.at_s < self.settings.settle_s + 0.5 * self._sent.lag_s - 1e-9:
            return False
        return abs(self._along(*self._sent.pending(now_s, stamp_s))) <= STILL_SHARE * self._tolerance

    def _judge_by_window(self, window: RestWindow, pose: Pose, left: float, now_s: float, stamp_s: float) -> None:
        """With noisy odometry: accept by mean and bound, correct, continue to read, or fail.

        A base with a lag still rolls while the window begins: `left` is what will be left at rest.
        """
        estimate = window.add(left, stamp_s)
        if estimate is not None and estimate.within(self._tolerance):
            self.status = MotionStatus.DONE
        elif estimate is not None and estimate.needs_correction(self._tolerance):
            self._correct_or_fail(pose, estimate.mean, now_s)

    def _judge(self, pose: Pose, error: float, now_s: float) -> None:
        """At rest: accept, start a correction, or fail."""
        exhausted = self.corrections >= self.settings.max_corrections
        good = self._tolerance if exhausted else self.settings.aim_share * self._tolerance
        if abs(error) < max(good, min(self._slowest.least(self._period_s), self._tolerance)):
            self.status = MotionStatus.DONE
        else:
            self._correct_or_fail(pose, error, now_s)

    def _correct_or_fail(self, pose: Pose, error: float, now_s: float) -> None:
        """Start a correction of `error`, or fail after the last correction."""
        if self.corrections >= self.settings.max_corrections:
            self.status = MotionStatus.FAILED
            self.failure = f"off after {self.corrections} corrections: {self._shortfall(pose)}"
        else:
            self.corrections += 1
            self._correction.begin(error)
            self._phase = _CORRECT if self._correction.is_reckoned else _DRIVE
            self._commanded = 0.0
            self._smoothing = RemainingFilter() if self._window is not None else None
            self._stall.restart()
            self._stall.is_stuck(now_s, -error, 0.0)

    def _stalled(self, left: float, now_s: float, stamp_s: float) -> bool:
        """Return whether the base covered too little of the commanded distance in the latest window."""
        if now_s - stamp_s > _STALE_SHARE * self._stall_s:
            return False
        return self._stall.is_stuck(now_s, -left, self._commanded)

    def _shortfall(self, pose: Pose) -> str:
        """Return the covered distance as text."""
        way, left = self._way, self.error(pose)
        if self._turns:
            return f"turned {math.degrees(way - left):.2f}° of {math.degrees(way):g}°"
        return f"moved {(way - left) * 100:.1f} cm of {way * 100:g} cm"


def _facing_left(pose: Pose) -> Pose:
    """Return the pose of a robot that faces to the left of another."""
    return Pose(pose.x_m, pose.y_m, pose.heading_rad + math.pi / 2)
