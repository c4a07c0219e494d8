"""Controller of a curved path: pure pursuit (Coulter 1992, CMU-RI-TR-92-01) with the speed profile of a move."""

import math

from vsnbench.control.command import STANDSTILL, Command, Controller, MotionStatus
from vsnbench.control.law import acceleration, braking_speed, speed, turn_error_rad
from vsnbench.control.paths.path_progress import PathProgress
from vsnbench.control.response import BaseResponse, SentCommands
from vsnbench.control.settings import MotionSettings
from vsnbench.control.slowest import SlowestVelocity
from vsnbench.control.stall import StallMonitor
from vsnbench.control.standstill import QUIET, PathRest, StandstillNoise, is_quiet
from vsnbench.values.pose import Pose, advanced

_TURN_ON_SPOT_RAD = math.radians(50)
"""With a larger bearing to the pursued point, the robot turns on the spot."""
_END_M = 0.002
_SLOWEST_M_S = 0.02
_OFF_PATH_M = 0.30
"""A robot farther than this from its path has failed to follow it."""
_STILL_M, _STILL_RAD = 0.002, math.radians(0.2)
_STALL_M, _STALL_RAD = 0.03, math.radians(5)
"""Commanded amounts that a base must follow within the stall time."""
_SMOOTHING_S = 0.3
_STALE_SHARE = 0.5
"""Maximum age of odometry for the stall test, as a share of the stall time."""


class PathController(Controller):
    """Follows a polyline to its end and settles there; the caller corrects what is left of the error.

    It steers by the pose that the base will have when all commands have taken effect: a base with a dead time of 50 ms
    and a motor lag of 80 ms would otherwise drive 4 cm past the end.

    Args:
        path: points in the frame of the odometry, from the robot's position on.
        settings: speeds, limits and tolerances.
        noise: noise of the odometry at rest.
        response: response of the base, if it is known.
    """

    def __init__(
        self,
        path: tuple[tuple[float, float], ...],
        settings: MotionSettings,
        noise: StandstillNoise = QUIET,
        response: BaseResponse | None = None,
    ) -> None:
        super().__init__()
        self._settings = settings
        self._path = PathProgress(path)
        self.length_m = self._path.length_m
        self._limit_s = 2 * self.length_m / settings.linear_m_s + len(path) * 3.0 + settings.timeout_s
        cruise_m_s, way_m = settings.linear_m_s, settings.forward_m
        self._acceleration = acceleration(cruise_m_s, way_m, settings.acceleration_share)
        self._deceleration = acceleration(cruise_m_s, way_m, settings.deceleration_share)
        response = response or BaseResponse(settings.latency_s)
        self._delay_s = response.delay_s
        self._sent = SentCommands(response)
        self._slowest_m_s = max(response.slowest_m_s, settings.slowest_m_s, _SLOWEST_M_S)
        slowest_rad_s = max(response.slowest_rad_s, settings.slowest_rad_s)
        self._slowest_turn = SlowestVelocity(slowest_rad_s, settings.angular_rad_s, math.inf, settings)
        self._speed = 0.0
        self._is_ending = False
        self._began_s: float | None = None
        self._last_s = 0.0
        self._is_noisy = not is_quiet(noise.position_m, _STILL_M)
        self._estimate: Pose | None = None
        self._stamp_s = -math.inf
        self._rest = PathRest(noise, settings.settle_s, _STILL_M, _STILL_RAD)
        self._stalls = StallMonitor(settings.stall_s, _STALL_M), StallMonitor(settings.stall_s, _STALL_RAD)
        self._commanded_m = self._commanded_rad = 0.0
        self._turning_rad_s = 0.0
        """Last turn that was commanded; a base with a slowest velocity turns in pulses."""

    @property
    def remaining_m(self) -> float:
        """Length of the path that is left."""
        return self._path.remaining_m

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
            self._began_s = now_s
            self._last_s = now_s - self._settings.control_period_s
        period_s = min(max(now_s - self._last_s, 0.0), 5 * self._settings.control_period_s)
        self._last_s = now_s
        self.duration_s = now_s - self._began_s
        if now_s - stamp_s > self._settings.odometry_timeout_s:
            self.sensor_lost = True
            return self.abort(f"no odometry for {now_s - stamp_s:.1f} s")
        if self.duration_s > self._limit_s:
            return self.abort(f"not done after {self.duration_s:.1f} s: {self._shortfall()}")
        pending_m, pending_rad = self._sent.pending(now_s, stamp_s)
        expected = self._smoothed(advanced(pose, pending_m, pending_rad), period_s, stamp_s)
        off_m = self._path.advance(expected)
        if off_m > _OFF_PATH_M:
            return self.abort(f"{off_m:.2f} m off its path: {self._shortfall()}")
        if self._is_stuck(pose, now_s, stamp_s, pending_m, pending_rad):
            return self.abort(f"the base does not follow its commands: {self._shortfall()}")
        if not self._is_ending and self.remaining_m <= max(_END_M, 0.5 * self._slowest_m_s * period_s):
            self._is_ending = True
            self._rest.begin(now_s + self._settings.settle_s + 2 * self._delay_s)
        if self._is_ending:
            if self._rest.add(pose, stamp_s):
                self.status = MotionStatus.DONE
            return STANDSTILL
        command = self._pursue(expected, period_s)
        if command.angular_rad_s * self._turning_rad_s < 0:
            self._stalls[1].restart()  # around a reversal, a base with an unknown lag covers nothing on balance
        self._turning_rad_s = command.angular_rad_s or self._turning_rad_s
        self._commanded_m += abs(command.linear_m_s) * period_s
        self._commanded_rad += command.angular_rad_s * period_s
        self._sent.add(now_s, command)
        return command

    def _smoothed(self, expected: Pose, period_s: float, stamp_s: float) -> Pose:
        """Return the expected pose; with noisy odometry by the commands, slowly corrected by each reading."""
        if self._estimate is None or not self._is_noisy:
            self._estimate, self._stamp_s = expected, stamp_s
            return expected
        sent = self._sent.last
        estimate = advanced(self._estimate, sent.linear_m_s * period_s, sent.angular_rad_s * period_s)
        share = 1 - math.exp((self._stamp_s - stamp_s) / _SMOOTHING_S)
        self._stamp_s = max(stamp_s, self._stamp_s)
        self._estimate = Pose(
            estimate.x_m + share * (expected.x_m - estimate.x_m),
            estimate.y_m + share * (expected.y_m - estimate.y_m),
            estimate.heading_rad + share * (expected.heading_rad - estimate.heading_rad),
        )
        return self._estimate

    def _pursue(self, pose: Pose, period_s: float) -> Command:
        x_m, y_m = self._path.pursued()
        reach_m = max(math.hypot(x_m - pose.x_m, y_m - pose.y_m), 0.05)
        bearing_rad = turn_error_rad(math.atan2(y_m - pose.y_m, x_m - pose.x_m), pose.heading_rad)
        fastest_rad_s = self._settings.angular_rad_s
        if abs(bearing_rad) > _TURN_ON_SPOT_RAD:
            self._speed = max(self._speed - self._deceleration * period_s, 0.0)
            turning_rad_s = math.copysign(min(fastest_rad_s, 2.0 * abs(bearing_rad)), bearing_rad)
            if self._speed < self._settings.slowest_m_s:
                self._speed = 0.0
            return Command(self._speed, turning_rad_s)
        curvature = 2 * math.sin(bearing_rad) / reach_m
        cornering_m_s = fastest_rad_s / abs(curvature) if curvature else math.inf
        faster = speed(self._speed, self._acceleration, (self._speed + self._acceleration * period_s / 2) * period_s)
        slower = braking_speed(self.remaining_m, self._deceleration, self._settings.control_period_s)
        self._speed = max(min(faster, self._settings.linear_m_s, slower, cornering_m_s), self._slowest_m_s)
        turning_rad_s = max(-fastest_rad_s, min(self._speed * curvature, fastest_rad_s))
        return Command(self._speed, self._slowest_turn.in_turns(turning_rad_s, period_s))

    def _is_stuck(self, pose: Pose, now_s: float, stamp_s: float, pending_m: float, pending_rad: float) -> bool:
        """Return whether the base covered too little of what it was commanded, without what is still to take effect."""
        if now_s - stamp_s > _STALE_SHARE * self._settings.stall_s:
            return False
        moves, turns = self._stalls
        stuck = moves.is_stuck(now_s, complex(pose.x_m, pose.y_m), self._commanded_m - pending_m)
        return turns.is_stuck(now_s, pose.heading_rad, self._commanded_rad - pending_rad) or stuck

    def _shortfall(self) -> str:
        return f"followed {self._path.progress_m:.2f} m of {self.length_m:.2f} m"
