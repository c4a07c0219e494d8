"""Follower of paths that replace each other while the robot drives: pure pursuit within speeds and accelerations.

`PathController` drives one path from rest to rest, and settles at its end. This follower keeps the velocity when a path
replaces another, so there is no jump where they join. The base stops at the end of the newest path.
"""

import math
from collections.abc import Sequence

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.law import acceleration, braking_speed, turn_error_rad
from vsnbench.control.paths.path_progress import PathProgress
from vsnbench.control.response import BaseResponse, SentCommands
from vsnbench.control.settings import MotionSettings
from vsnbench.control.slowest import SlowestVelocity
from vsnbench.control.stall import DRIVE_SHARE, StallMonitor
from vsnbench.values.movement import Drive, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose, advanced

_TURN_WHILE_DRIVING_RAD = math.radians(50)
"""With a larger bearing to the pursued point, the robot brakes and turns on the spot."""
_TURN_AT_REST_RAD = math.radians(10)
"""The same at rest: a robot that starts turns first, because its camera then shows the path before it drives. Between
rest and `_SLOW_SHARE` of the cruising speed, the limit grows with the speed."""
_SLOW_SHARE = 0.5
_FACED_RAD = math.radians(4)
"""A turn on the spot ends below this bearing."""
_END_HEADING_RAD = math.radians(1)
_SLOWEST_M_S, _SLOWEST_RAD_S = 0.02, 0.02
_END_M = 0.004
_REACHED_M = 0.02
"""A waypoint nearer than this is reached."""
_STALL_M, _STALL_RAD = 0.03, math.radians(5)
"""Commanded amounts that a base must follow within the stall time."""
_STALE_SHARE = 0.5
"""Maximum age of odometry for the stall test, as a share of the stall time."""


class PathFollower:
    """Follows the newest path; it has no clock and no robot.

    On a base with slowest velocities, ramps begin and end at these, and slower turns along a path are made in pulses.

    Attributes:
        failure: why it cannot go on, or an empty string; it then commands zero velocity.
        sensor_lost: whether missing odometry is the reason.
    """

    def __init__(self, settings: MotionSettings, response: BaseResponse | None = None) -> None:
        self._settings = settings
        share = settings.acceleration_share
        self._linear_m_s2 = acceleration(settings.linear_m_s, settings.forward_m, share)
        self._angular_rad_s2 = acceleration(settings.angular_rad_s, settings.turn_rad, share)
        self._lateral_m_s2 = 0.0
        if settings.lateral_m_s:
            self._lateral_m_s2 = acceleration(settings.lateral_m_s, settings.forward_m, share)
        self._slowest_turn = SlowestVelocity(settings.slowest_rad_s, settings.angular_rad_s, math.inf, settings)
        self._sent = SentCommands(response or BaseResponse(settings.latency_s))
        self._path: PathProgress | None = None
        self._joins = False
        self._end_rad: float | None = None
        self._velocity: Velocity | None = None
        self._velocity_until_s = -math.inf
        self._turns = False
        self._last_s: float | None = None
        self.failure = ""
        self.sensor_lost = False
        self.may_leave = True
        """Whether it may leave rest forwards; without that it waits."""
        self.would_leave = False
        """Whether it left rest forwards with the newest command, or waits for that."""
        stall_s = DRIVE_SHARE * settings.stall_s
        self._stalls = StallMonitor(stall_s, _STALL_M), StallMonitor(stall_s, _STALL_RAD)
        self._commanded_m = self._commanded_rad = 0.0
        self.command = STANDSTILL
        """The newest command."""

    @property
    def has_path(self) -> bool:
        """Whether there is something left to drive."""
        return self._path is not None or self._velocity is not None or self._end_rad is not None

    @property
    def waits(self) -> bool:
        """Whether the path has ended, and the robot is commanded to rest until it gets another."""
        return not self.has_path and self.command == STANDSTILL

    @property
    def remaining_m(self) -> float:
        """Length of the path that is left; infinity if it is not known."""
        if self._velocity is not None:
            return math.inf
        return 0.0 if self._path is None else self._path.remaining_m

    def follow(self, movement: Drive, origin: Pose, here: Pose) -> None:
        """Replace the running path.

        Args:
            movement: one of a kind that `replaces_path`.
            origin: pose in the odometry's frame that the movement is relative to.
            here: the robot's odometry.
        """
        self._path, self._end_rad, self._velocity = None, None, None
        match movement:
            case Waypoint(x_m, y_m, heading_rad):
                target = origin.compose(Pose(x_m, y_m)).position
                if math.dist(target, here.position) > _REACHED_M:
                    self._path = PathProgress((here.position, target))
                self._end_rad = None if heading_rad is None else origin.heading_rad + heading_rad
            case Trajectory(points):
                self._path = PathProgress(_distinct([origin.position, *_placed(points, origin)]))
                self._joins = True
            case Velocity():
                self._velocity, self._velocity_until_s = self._settings.executable(movement), math.inf
            case _:
                raise TypeError(f"a {movement.kind} cannot replace a running path")

    def brake(self) -> None:
        """Drop the path, and slow down to rest within the accelerations of the base."""
        self._path, self._end_rad, self._velocity = None, None, None

    def stop(self) -> None:
        """Drop the path, and command zero velocity at once."""
        self.brake()
        self.command = STANDSTILL
        self._turns = False

    def step(self, pose: Pose, now_s: float, stamp_s: float) -> Command:
        """Process the newest odometry and return the velocity to command from now on.

        Args:
            pose: odometry.
            now_s: time.
            stamp_s: time of the odometry, at most `now_s`.
        """
        period_s = self._settings.control_period_s
        if self._last_s is not None:
            period_s = min(max(now_s - self._last_s, 0.0), 5 * period_s)
        self._last_s = now_s
        if now_s - stamp_s > self._settings.odometry_timeout_s:
            self.sensor_lost = True
            return self._failed(f"no odometry for {now_s - stamp_s:.1f} s")
        pending_m, pending_rad = self._sent.pending(now_s, stamp_s)
        if self._is_stuck(pose, now_s, stamp_s, pending_m, pending_rad):
            return self._failed("the base does not follow its commands")
        wanted = self._wanted(advanced(pose, pending_m, pending_rad), now_s, period_s)
        before, self.command = self.command, self._limited(wanted, period_s)
        self.would_leave = not before.linear_m_s and self.command.linear_m_s > 0
        if self.would_leave and not self.may_leave:
            self.command = STANDSTILL
        if self.command.angular_rad_s * before.angular_rad_s < 0:
            self._stalls[1].restart()  # around a reversal, a base with an unknown lag covers nothing on balance
        self._commanded_m += self.command.speed_m_s * period_s
        self._commanded_rad += self.command.angular_rad_s * period_s
        self._sent.add(now_s, self.command)
        return self.command

    def _failed(self, reason: str) -> Command:
        self.failure = reason
        self.stop()
        return STANDSTILL

    def _wanted(self, pose: Pose, now_s: float, period_s: float) -> Command:
        """Return the velocity without regard to accelerations."""
        if self._velocity is not None:
            if self._velocity_until_s == math.inf:
                self._velocity_until_s = now_s + self._velocity.duration_s
            if now_s < self._velocity_until_s - period_s / 2:
                limit_m_s, limit_rad_s = self._settings.linear_m_s, self._settings.angular_rad_s
                aside_m_s = self._settings.lateral_m_s
                return Command(
                    max(-limit_m_s, min(self._velocity.linear_m_s, limit_m_s)),
                    max(-limit_rad_s, min(self._velocity.angular_rad_s, limit_rad_s)),
                    max(-aside_m_s, min(self._velocity.lateral_m_s, aside_m_s)),
                )
            self._velocity = None
        if self._path is not None:
            if self._joins:
                self._joins = False
                self._path.join(pose)
            self._path.advance(pose)
            if self._path.remaining_m > max(_END_M, 0.5 * abs(self.command.linear_m_s) * period_s):
                return self._pursuing(self._path, pose, period_s)
            self._path, self._turns = None, False
        if self._end_rad is not None:
            error_rad = turn_error_rad(self._end_rad, pose.heading_rad)
            if abs(error_rad) > _END_HEADING_RAD:
                return self._turning(error_rad, period_s)
            self._end_rad = None
        return STANDSTILL

    def _pursuing(self, path: PathProgress, pose: Pose, period_s: float) -> Command:
        x_m, y_m = path.pursued()
        reach_m = max(math.hypot(x_m - pose.x_m, y_m - pose.y_m), 0.05)
        bearing_rad = turn_error_rad(math.atan2(y_m - pose.y_m, x_m - pose.x_m), pose.heading_rad)
        share = min(max(self.command.linear_m_s, 0.0) / (_SLOW_SHARE * self._settings.linear_m_s), 1.0)
        limit_rad = _TURN_AT_REST_RAD + share * (_TURN_WHILE_DRIVING_RAD - _TURN_AT_REST_RAD)
        self._turns = abs(bearing_rad) > (_FACED_RAD if self._turns else limit_rad)
        if self._turns:
            return self._turning(bearing_rad, period_s)
        curvature = 2 * math.sin(bearing_rad) / reach_m
        fastest_rad_s = self._settings.angular_rad_s
        cornering_m_s = fastest_rad_s / abs(curvature) if curvature else math.inf
        slower = braking_speed(path.remaining_m, self._linear_m_s2, self._settings.control_period_s)
        wanted_m_s = max(
            min(self._settings.linear_m_s, slower, cornering_m_s), self._settings.slowest_m_s, _SLOWEST_M_S
        )
        driven_m_s = self._limited(Command(wanted_m_s), period_s).linear_m_s
        turning_rad_s = max(-fastest_rad_s, min(driven_m_s * curvature, fastest_rad_s))
        return Command(wanted_m_s, self._slowest_turn.in_turns(turning_rad_s, period_s))

    def _turning(self, error_rad: float, period_s: float) -> Command:
        fastest_rad_s = self._settings.angular_rad_s
        slower = braking_speed(abs(error_rad), self._angular_rad_s2, period_s)
        return Command(
            0.0, math.copysign(max(min(fastest_rad_s, slower), self._settings.slowest_rad_s, _SLOWEST_RAD_S), error_rad)
        )

    def _limited(self, wanted: Command, period_s: float) -> Command:
        """Return what the accelerations and the slowest velocities of the base permit in one period."""
        now, slowest_m_s, slowest_rad_s = self.command, self._settings.slowest_m_s, self._settings.slowest_rad_s
        return Command(
            _towards(now.linear_m_s, wanted.linear_m_s, self._linear_m_s2 * period_s, slowest_m_s),
            _towards(now.angular_rad_s, wanted.angular_rad_s, self._angular_rad_s2 * period_s, slowest_rad_s),
            _towards(
                now.lateral_m_s,
                wanted.lateral_m_s,
                self._lateral_m_s2 * period_s,
                self._settings.slowest_lateral_m_s,
            ),
        )

    def _is_stuck(self, pose: Pose, now_s: float, stamp_s: float, pending_m: float, pending_rad: float) -> bool:
        """Return whether the base covered too little of what it was commanded, without what is still to take effect."""
        if now_s - stamp_s > _STALE_SHARE * self._settings.stall_s:
            return False
        moves, turns = self._stalls
        stuck = moves.is_stuck(now_s, complex(pose.x_m, pose.y_m), self._commanded_m - pending_m)
        return turns.is_stuck(now_s, pose.heading_rad, self._commanded_rad - pending_rad) or stuck


def _towards(now: float, wanted: float, most: float, slowest: float) -> float:
    velocity = now + max(-most, min(wanted - now, most))
    if abs(velocity) >= slowest:
        return velocity
    return math.copysign(slowest, wanted) if wanted else 0.0


def _placed(points: Sequence[tuple[float, float]], origin: Pose) -> list[tuple[float, float]]:
    return [origin.compose(Pose(x_m, y_m)).position for x_m, y_m in points]


def _distinct(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Return points without repetitions, of which a path needs two at least."""
    kept = [point for k, point in enumerate(points) if k == 0 or math.dist(point, points[k - 1]) > 1e-6]
    return tuple(kept) if len(kept) > 1 else (points[0], (points[0][0] + 1e-6, points[0][1]))
