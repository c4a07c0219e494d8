"""Drives a simulated base that does not stop while a model thinks: `Robot.follow`, `advance` and `come_to_rest`."""

import math
from collections.abc import Callable

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.paths.path_follower import PathFollower
from vsnbench.control.settings import MotionSettings
from vsnbench.robots.contract import DrivingView, Watch
from vsnbench.robots.simulated_mover import SimulatedMover
from vsnbench.simulator.dynamics.driven_base import DrivenBase
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, Touch
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Drive
from vsnbench.values.pose import Pose

LOOK_PERIOD_S = 0.1
"""Simulated time between two depth images while a robot moves."""
_REST_M, _REST_RAD = 0.0005, math.radians(0.1)
_REST_S = 0.2
"""A base that moved less than the two amounts before it in this time is at rest."""
_LONGEST_REST_S = 3.0
"""The odometry of a base with noise is never still."""


class DrivingOn:
    """The continuous motion of one episode; time passes only in `advance` and `come_to_rest`.

    Args:
        settings: speeds and accelerations.
        mover: sends commands to a base that is not ideal; None for an ideal base.
        base: the base.
        read: returns its newest odometry and the time of it; `fresh=True` measures now, whatever the rate of messages.
        look: returns what the camera sees while a command is executed, with the length of the path that is left.
        name_of: names a touched object.
    """

    def __init__(
        self,
        settings: MotionSettings,
        mover: SimulatedMover | None,
        base: DrivenBase,
        read: Callable[..., tuple[Pose, float]],
        look: Callable[[Command, float], DrivingView],
        name_of: Callable[[Touch], str],
    ) -> None:
        self._settings = settings
        self._mover = mover
        self._base = base
        self._read = read
        self._look = look
        self._name_of = name_of
        self._follower = PathFollower(settings)
        self._looked_s = -math.inf
        self._begin()

    @property
    def _now_s(self) -> float:
        return self._base.physics.time_s

    def _begin(self) -> None:
        self._start, _ = self._read(fresh=True)
        self._start_s = self._now_s
        self._path_m = self._waiting_s = 0.0
        if self._mover is not None:
            self._mover.path_m = 0.0
        self._blocked = ""
        self._touch: Touch | None = None

    def follow(self, movement: Drive, anchor: Pose | None) -> None:
        """Replace the running path; see `Robot.follow`."""
        here, _ = self._read(fresh=True)
        self._follower.follow(movement, here if anchor is None else anchor, here)

    def advance(self, until_s: float, watch: Watch | None) -> MotionResult:
        """Let time pass; see `Robot.advance`."""
        self._begin()
        while self._now_s < until_s - CONTROL_PERIOD_S / 2 and self._touch is None and not self._follower.failure:
            self._period(watch)
        return self._ended()

    def come_to_rest(self) -> MotionResult:
        """Brake; see `Robot.come_to_rest`."""
        self._begin()
        self._follower.brake()
        rests_from_s, last = self._now_s, self._start
        while (
            self._now_s - self._start_s < _LONGEST_REST_S
            and self._now_s - rests_from_s < _REST_S
            and self._touch is None
        ):
            before = self._follower.command
            self._period(None)
            here, _ = self._read(fresh=True)
            moves = here.distance_to(last) > _REST_M or abs(here.heading_rad - last.heading_rad) > _REST_RAD
            if moves or before != STANDSTILL:
                rests_from_s, last = self._now_s, here
        self._waiting_s = 0.0
        return self._ended()

    def halt(self) -> None:
        """Drop the path, and command zero velocity from now on."""
        self._follower.stop()

    def _ended(self) -> MotionResult:
        result = self.motion()
        self._begin()
        return result

    def motion(self) -> MotionResult:
        """Return the motion since `advance` or `come_to_rest` began; none if it has returned."""
        here, _ = self._read(fresh=True)
        touched = None if self._touch is None else Collision(CollisionSource.CONTACT, self._name_of(self._touch))
        failure = f"touched {touched.touched}" if touched is not None else self._follower.failure
        return MotionResult(
            completed=not failure and not self._blocked,
            displacement_m=self._start.distance_to(here),
            turn_rad=here.heading_rad - self._start.heading_rad,
            duration_s=self._now_s - self._start_s,
            collision=touched,
            failure=failure,
            pose=here.wrapped,
            path_m=self._path_m if self._mover is None else self._mover.path_m,
            blocked=self._blocked,
            sensor_lost=self._follower.sensor_lost,
            waiting_s=self._waiting_s,
        )

    def _period(self, watch: Watch | None) -> None:
        """Let one control period pass."""
        follower, now_s = self._follower, self._now_s
        here, stamp_s = self._read()
        driving = follower.command
        command = follower.step(here, now_s, stamp_s)
        is_due = now_s - self._looked_s >= LOOK_PERIOD_S - CONTROL_PERIOD_S / 2
        leaves = bool(command.linear_m_s) and not driving.linear_m_s
        if watch is not None and (leaves or (is_due and (driving.linear_m_s or driving.angular_rad_s))):
            self._looked_s = now_s
            if reason := watch(self._look(STANDSTILL if leaves else driving, follower.remaining_m)):
                self._blocked = reason
                follower.stop()
                command = STANDSTILL
        if follower.waits:
            self._waiting_s += CONTROL_PERIOD_S
        self._touch = self._base.drive(command) if self._mover is None else self._mover.hold(command)
        after, _ = self._read()
        self._path_m += here.distance_to(after)
        if self._touch is not None:
            follower.stop()
            self._base.physics.stop()
