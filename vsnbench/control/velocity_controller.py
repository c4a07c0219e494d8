"""Controller of a velocity that is held for a time: ramp up, hold, ramp down, settle."""

import math

from vsnbench.control.command import STANDSTILL, Command, Controller, MotionStatus
from vsnbench.control.settings import MotionSettings
from vsnbench.control.stall import StallMonitor
from vsnbench.control.standstill import QUIET, PathRest, StandstillNoise
from vsnbench.values.movement import Velocity
from vsnbench.values.pose import Pose, wrap_angle

_STALL_SHARE = 0.1
"""A base is stuck if it covers less than this share of what was commanded by the end."""
_STALL_M, _STALL_RAD = 0.03, math.radians(5)
"""Commanded amounts above which a base that does not move is stuck."""
_STALE_SHARE = 0.5
"""Maximum age of odometry for the stall test, as a share of the stall time."""
_STILL_M, _STILL_RAD = 0.002, math.radians(0.2)
_SETTLE_LIMIT_S = 3.0


class VelocityController(Controller):
    """Holds a velocity within the limits of the base; the ramps are part of the duration.

    The ramps use the acceleration of a discrete action, or a higher one if the duration is shorter than they are; a
    base that cannot follow a higher one does not reach the velocity then. The base is done when the time is over and
    it is at rest. Its parts are `MotionSettings.executable`; ramps begin and end at the slowest velocity of the base.
    """

    def __init__(
        self, velocity: Velocity, start: Pose, settings: MotionSettings, noise: StandstillNoise = QUIET
    ) -> None:
        super().__init__()
        self._settings = settings
        self._velocity = velocity = settings.executable(velocity)
        self._last = start
        self._rest = PathRest(noise, settings.settle_s, _STILL_M, _STILL_RAD)
        self._is_ending = False
        self._began_s: float | None = None
        self._last_s = 0.0
        self._commanded_m = self._commanded_rad = 0.0
        self._covered_m = self._covered_rad = 0.0
        self._stalls = StallMonitor(settings.stall_s, _STALL_M), StallMonitor(settings.stall_s, _STALL_RAD)
        angular_rad_s, forward_m = abs(velocity.angular_rad_s), settings.acceleration_share * settings.forward_m
        rises_s = [
            _rise_s(abs(velocity.linear_m_s), settings.linear_m_s, forward_m),
            _rise_s(angular_rad_s, settings.angular_rad_s, settings.acceleration_share * settings.turn_rad),
        ]
        if velocity.lateral_m_s:
            rises_s.append(_rise_s(abs(velocity.lateral_m_s), settings.lateral_m_s, forward_m))
        self._rise_s = max(rises_s) if settings.ramps_are_limits else min(max(rises_s), velocity.duration_s / 2)

    @property
    def remaining_m(self) -> float:
        """Distance that the velocity still covers."""
        left_s = max(self._velocity.duration_s - self.duration_s, 0.0)
        return self._velocity.speed_m_s * left_s

    @property
    def rest_since_s(self) -> float:
        """Time since when the base has been at rest, if noisy readings were averaged; infinity otherwise."""
        return self._rest.since_s

    def step(self, pose: Pose, now_s: float, stamp_s: float | None = None) -> Command:
        """Process the newest odometry and return the velocity to command from now on; see `MotionController.step`."""
        if self.status is not MotionStatus.MOVING:
            return STANDSTILL
        stamp_s = now_s if stamp_s is None else min(stamp_s, now_s)
        if self._began_s is None:
            self._began_s = self._last_s = now_s
        self.duration_s = now_s - self._began_s
        self._covered_m += pose.distance_to(self._last)
        self._covered_rad += abs(wrap_angle(pose.heading_rad - self._last.heading_rad))
        self._last = pose
        if now_s - stamp_s > self._settings.odometry_timeout_s:
            self.sensor_lost = True
            return self.abort(f"no odometry for {now_s - stamp_s:.1f} s")
        if self.duration_s > self._velocity.duration_s + _SETTLE_LIMIT_S:
            return self.abort(f"the base has not stopped {_SETTLE_LIMIT_S:.0f} s after the velocity ended")
        if self._is_stuck(pose, now_s, stamp_s):
            return self.abort("the base does not follow its commands")
        share = self._share()
        if share <= 0.0:
            if not self._is_ending:
                self._is_ending = True
                self._rest.begin(now_s + self._settings.settle_s)
            return self._settle(pose, stamp_s)
        wanted = self._velocity
        command = self._settings.sendable(
            Command(share * wanted.linear_m_s, share * wanted.angular_rad_s, share * wanted.lateral_m_s)
        )
        period_s = now_s - self._last_s
        self._last_s = now_s
        self._commanded_m += command.speed_m_s * period_s
        self._commanded_rad += abs(command.angular_rad_s) * period_s
        return command

    def _is_stuck(self, pose: Pose, now_s: float, stamp_s: float) -> bool:
        if now_s - stamp_s > _STALE_SHARE * self._settings.stall_s:
            return False
        moves, turns = self._stalls
        stuck = moves.is_stuck(now_s, complex(pose.x_m, pose.y_m), self._commanded_m)
        return turns.is_stuck(now_s, pose.heading_rad, self._commanded_rad) or stuck

    def _share(self) -> float:
        """Return the share of the velocity to command now, from 0 to 1."""
        left_s = self._velocity.duration_s - self.duration_s
        if left_s <= self._settings.control_period_s / 2:
            return 0.0
        if self._rise_s <= 0.0:
            return 1.0
        return min(1.0, (self.duration_s + self._settings.control_period_s) / self._rise_s, left_s / self._rise_s)

    def _settle(self, pose: Pose, stamp_s: float) -> Command:
        if self._rest.add(pose, stamp_s):
            is_stuck = (self._commanded_m > _STALL_M and self._covered_m < _STALL_SHARE * self._commanded_m) or (
                self._commanded_rad > _STALL_RAD and self._covered_rad < _STALL_SHARE * self._commanded_rad
            )
            if is_stuck:
                return self.abort("the base does not follow its commands")
            self.status = MotionStatus.DONE
        return STANDSTILL


def _rise_s(speed: float, cruise: float, way: float) -> float:
    """Return the time to reach a speed with the acceleration that reaches `cruise` within `way`."""
    return speed * 2 * way / cruise**2
