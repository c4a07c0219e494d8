"""The state machine of one discrete motion: drive by the profile, stand still, measure, correct, or say why not."""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from vsnbench.motion.law import (
    acceleration,
    braking_speed,
    deceleration,
    direction,
    ideal_duration_s,
    speed,
    straight_error_m,
    turn_error_rad,
)
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.pose import Pose, wrap_angle

_COARSE = 4.0
"""An error of more tolerances than this is driven off under feedback, a smaller one by dead reckoning."""
_STILL_SHARE = 0.2
"""Standing still means moving less than this share of the tolerance within the settling time."""
_STALL_SHARE = 0.1
"""A base that covers less than this share of what was commanded is stuck."""
_LEARNING_SHARES = (0.1, 0.6)
"""The part of the way on which the dead time is measured: no longer standing, not yet braking."""
_MAX_LATENCY_S = 0.5
"""A longer dead time is a base that falls short of its commands, not one that is late."""


class MotionStatus(StrEnum):
    """Where a motion stands."""

    MOVING = "moving"
    DONE = "done"
    FAILED = "failed"


class _Phase(StrEnum):
    DRIVE = "drive"
    SETTLE = "settle"
    CORRECT = "correct"


# A name of this module costs half of what an enum's member costs, and a period asks for several.
_MOVING = MotionStatus.MOVING
_DRIVE, _SETTLE, _CORRECT = _Phase.DRIVE, _Phase.SETTLE, _Phase.CORRECT


@dataclass(frozen=True, slots=True)
class Command:
    """A velocity of the base: forward, and counter-clockwise."""

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0


STANDSTILL = Command()


class _Sent(NamedTuple):
    """A command and when it was sent; a tuple, since several are made every period of simulated time."""

    at_s: float
    command: Command


class _Mark(NamedTuple):
    """How much of the way was covered, or commanded, by a moment."""

    at_s: float
    amount: float


class MotionController:
    """One action from its start to its end; it owns no clock and no robot.

    Feed it the newest odometry with `step` about every `settings.control_period_s`, send the base what it returns,
    and stop when `status` is no longer MOVING. Old odometry is no trouble: what was commanded since it was measured
    is added to it, at any odometry rate. The dead time between a command and its effect in the odometry is measured
    while speeding up. The result is only judged while standing still; a small remainder is corrected by dead
    reckoning.

    A turn goes to the absolute `target_heading_rad` (see `heading_after`); a straight move holds that heading.
    """

    def __init__(self, action: Action, start: Pose, target_heading_rad: float, settings: MotionSettings) -> None:
        self.action = action
        self.settings = settings
        self.status = MotionStatus.MOVING
        self.failure = ""
        self.sensor_lost = False
        self.corrections = 0
        self.duration_s = 0.0
        self._start = start
        self._target_heading_rad = target_heading_rad
        self._phase = _DRIVE
        self._began_s: float | None = None
        self._last_s = 0.0
        self._last_heading_rad = start.heading_rad
        self._turned_rad = 0.0
        self._speed = 0.0
        self._commanded = 0.0
        self._sent: deque[_Sent] = deque()
        self._still_since: _Mark | None = None
        self._covered_since: _Mark | None = None
        self._commanded_since = 0.0
        self._correction = 0.0
        self._latency_s = settings.latency_s
        self._commands: list[_Mark] = []
        if action is Action.STOP:
            self.status = MotionStatus.DONE
            return
        self._way = settings.way(action)
        self._sign = direction(action)
        self._turns = action.turns
        self._cruise = settings.cruise(action)
        self._limit_s = ideal_duration_s(action, settings) + settings.timeout_s
        self._period_s = settings.control_period_s
        self._stall_s = settings.stall_s
        self._odometry_timeout_s = settings.odometry_timeout_s
        self._tolerance = settings.tolerance(action)
        self._acceleration = acceleration(action, settings)
        self._deceleration = deceleration(action, settings)
        # The nominal turn plus the deviation from it: a half turn has no shorter way round.
        nominal_rad = self._sign * self._way
        self._turn_rad = nominal_rad + turn_error_rad(target_heading_rad, start.heading_rad + nominal_rad)

    @property
    def done(self) -> bool:
        """Whether the motion ended within its tolerance."""
        return self.status is MotionStatus.DONE

    def abort(self, reason: str) -> Command:
        """End the motion as failed, for a reason that only the caller can know; returns the command to stand still."""
        if self.status is MotionStatus.MOVING:
            self.status = MotionStatus.FAILED
            self.failure = reason
        return STANDSTILL

    def step(self, pose: Pose, now_s: float, stamp_s: float | None = None) -> Command:
        """Take the newest odometry and return the velocity to command from now on.

        Args:
            pose: the newest odometry, in the frame of the `start` pose.
            now_s: the caller's clock; any zero, never backwards.
            stamp_s: when `pose` was measured, on the same clock; now when left out.
        """
        if self.status is not _MOVING:
            return STANDSTILL
        stamp_s = now_s if stamp_s is None else min(stamp_s, now_s)
        if self._began_s is None:
            self._began_s, self._last_s = now_s, now_s - self._period_s
        period_s = max(now_s - self._last_s, 0.0)
        self._last_s = now_s
        self.duration_s = now_s - self._began_s
        self._turned_rad += wrap_angle(pose.heading_rad - self._last_heading_rad)
        self._last_heading_rad = pose.heading_rad
        left = self.error(pose)
        if self._sent:
            sent = self._sent[-1].command
            self._commanded += self._along(sent.linear_m_s, sent.angular_rad_s) * period_s
        if self._phase is _DRIVE and not self.corrections:
            self._learn_latency(left, now_s, stamp_s)
        if now_s - stamp_s > self._odometry_timeout_s:
            self.sensor_lost = True
            return self.abort(f"no odometry for {now_s - stamp_s:.1f} s")
        if self.duration_s > self._limit_s:
            return self.abort(f"not done after {self.duration_s:.1f} s: {self._shortfall(pose)}")
        if self._stalled(left, now_s):
            return self.abort(f"the base does not follow its commands: {self._shortfall(pose)}")
        command = self._next(pose, left, now_s, stamp_s, min(period_s, 5 * self._period_s))
        if self.status is not _MOVING:
            return STANDSTILL
        self._sent.append(_Sent(now_s, command))
        return command

    def error(self, pose: Pose) -> float:
        """Return what is left of the way at `pose`: metres or radians, positive in the direction of the action."""
        if self._turns:
            return self._sign * (self._turn_rad - self._turned_rad)
        return straight_error_m(self._way, self._start, pose)

    def _next(self, pose: Pose, left: float, now_s: float, stamp_s: float, period_s: float) -> Command:
        """Return the next command of the phase, or change the phase; `left` is the error at `pose`."""
        if self._phase is _SETTLE:
            if not self._settled(left, stamp_s):
                return STANDSTILL
            self._judge(pose, left, now_s)
            if self.status is not _MOVING or self._phase is _SETTLE:
                return STANDSTILL
        pending: tuple[float, float] | None = None
        if self._phase is _CORRECT:
            # Counted in commands alone: while the robot creeps, late odometry would only mislead.
            remaining = self._correction - self._commanded
        else:
            pending = self._pending(now_s, stamp_s)
            remaining = left - self._along(*pending)
        way = 1.0 if self._way_sign() >= 0 else -1.0
        if remaining * way <= 0.1 * self._tolerance:
            self._phase, self._speed, self._still_since = _SETTLE, 0.0, None
            return STANDSTILL
        faster = speed(self._speed, self._acceleration, (self._speed + self._acceleration * period_s / 2) * period_s)
        slower = braking_speed(remaining * way, self._deceleration, max(period_s, self._period_s))
        self._speed = min(faster, self._cruise, slower)
        signed = self._sign * (way * self._speed)
        if self._turns:
            return Command(angular_rad_s=signed)
        _, turning_rad = pending if pending is not None else self._pending(now_s, stamp_s)
        return Command(signed, self._holding_rad_s(pose.heading_rad + turning_rad))

    def _way_sign(self) -> float:
        """Return the sign of the present drive along the action: a correction may have to go back."""
        return self._correction if self.corrections else 1.0

    def _holding_rad_s(self, heading_rad: float) -> float:
        """Return how fast to turn during a move, so that it holds its heading."""
        hold_rad_s = self.settings.heading_gain_per_s * turn_error_rad(self._target_heading_rad, heading_rad)
        limit_rad_s = self.settings.angular_rad_s
        return max(-limit_rad_s, min(hold_rad_s, limit_rad_s))

    def _along(self, linear: float, angular: float) -> float:
        """Return the part of a velocity, or of its integral, that goes in the direction of the action."""
        return self._sign * (angular if self._turns else linear)

    def _pending(self, now_s: float, stamp_s: float) -> tuple[float, float]:
        """Return the motion commanded since the odometry was measured: metres and radians, not velocities."""
        since_s = stamp_s - self._latency_s
        while len(self._sent) > 1 and self._sent[1].at_s <= since_s:
            self._sent.popleft()
        linear_m = angular_rad = 0.0
        until_s = now_s
        for at_s, command in reversed(self._sent):
            lasted_s = until_s - (at_s if at_s > since_s else since_s)
            if lasted_s <= 0.0:
                lasted_s = 0.0  # a comparison costs a third of a call of max, and this is every period's
            linear_m += command.linear_m_s * lasted_s
            angular_rad += command.angular_rad_s * lasted_s
            until_s = at_s
        return linear_m, angular_rad

    def _learn_latency(self, left: float, now_s: float, stamp_s: float) -> None:
        """On the first drive: compare when the base had come this far with when the commands had asked for it."""
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
        self._latency_s = min(max(stamp_s - asked_s, 0.0), _MAX_LATENCY_S)

    def _settled(self, left: float, stamp_s: float) -> bool:
        """Return whether the measured pose has not changed for the settling time."""
        still = self._still_since
        if still is None or abs(left - still.amount) > _STILL_SHARE * self._tolerance:
            self._still_since = _Mark(stamp_s, left)
            return False
        return stamp_s - still.at_s >= self.settings.settle_s + self._latency_s - 1e-9

    def _judge(self, pose: Pose, error: float, now_s: float) -> None:
        """Standing still: accept, start a correction, or give up."""
        exhausted = self.corrections >= self.settings.max_corrections
        good = self._tolerance if exhausted else self.settings.aim_share * self._tolerance
        if abs(error) < good:
            self.status = MotionStatus.DONE
        elif exhausted:
            self.status = MotionStatus.FAILED
            self.failure = f"off after {self.corrections} corrections: {self._shortfall(pose)}"
        else:
            self.corrections += 1
            self._phase = _DRIVE if abs(error) > _COARSE * self._tolerance else _CORRECT
            self._correction = error
            self._commanded = self._commanded_since = 0.0
            self._covered_since = _Mark(now_s, -error)

    def _stalled(self, left: float, now_s: float) -> bool:
        """Return whether the base covered next to nothing of a whole interval's commands."""
        mark, covered = self._covered_since, -left
        if mark is not None and now_s - mark.at_s < self._stall_s:
            return False
        commanded = abs(self._commanded - self._commanded_since)
        self._covered_since, self._commanded_since = _Mark(now_s, covered), self._commanded
        if mark is None or commanded <= _COARSE * self._tolerance:
            return False
        return abs(covered - mark.amount) < _STALL_SHARE * commanded

    def _shortfall(self, pose: Pose) -> str:
        """Return in words how much of the way was covered."""
        way, left = self._way, self.error(pose)
        if self._turns:
            return f"turned {math.degrees(way - left):.2f}° of {math.degrees(way):g}°"
        return f"moved {(way - left) * 100:.1f} cm of {way * 100:g} cm"
