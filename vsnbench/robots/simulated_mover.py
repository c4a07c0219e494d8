"""The mover of robots over ROS on a simulated base in this process, in simulated time.

A base that is late, noisy or deaf to slow commands needs what real bases need: readings at rest, a measured response,
corrections. An ideal base is driven without them by `SimulatedRobot`.
"""

import math
from collections.abc import Callable

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.control.settings import MotionSettings
from vsnbench.sensing.mover import Mover
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.simulator.dynamics.driven_base import DrivenBase
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, Touch
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Drive
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import IDEAL_BASE, RobotProfile

_FIRST_REST_S = 0.5
"""Time at rest before the first movement, in which the noise of the odometry is measured."""


class _EndedError(Exception):
    """The base touched something, or the way ahead is not free."""


class SimulatedMover:
    """Drives one episode's base from its placement on.

    Attributes:
        reading: newest odometry, with an unwrapped heading.
        reading_s: its time.
        path_m: length of the path since the last movement began, by the odometry.
        touch: contact that ended the last movement, or None.
    """

    def __init__(self, base: DrivenBase, profile: RobotProfile, settings: MotionSettings) -> None:
        self._base = base
        dynamics = profile.dynamics or IDEAL_BASE
        self._roll_out_s = dynamics.dead_time_s + 5 * dynamics.motor_time_constant_s
        self._period_s = 1 / (dynamics.odometry_rate_hz or profile.base.odometry_rate_hz)
        self._command = STANDSTILL
        self._due_s = 0.0
        self.reading = self._measured = Pose(0.0, 0.0, 0.0)
        self.reading_s = 0.0
        self.path_m = 0.0
        self.touch: Touch | None = None
        tracker = OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s)
        self._mover = Mover(self._send, settings, tracker, self._now_s, self._sleep_until, self._now_s)
        self._sleep_until(_FIRST_REST_S)

    @property
    def command(self) -> Command:
        """Velocity that is commanded now."""
        return self._command

    def drive(self, movement: Drive, blocked: Callable[[], str]) -> MotionResult:
        """Execute a movement; a contact ends it, and so does a reason that `blocked` returns."""
        self.path_m, self.touch = 0.0, None

        def has_to_end() -> bool:
            if self.touch is not None or blocked():
                raise _EndedError
            return False

        try:
            result = self._mover.drive(movement, has_to_end)
        except _EndedError:
            self._base.physics.stop()
            result = MotionResult(completed=False, failure="ended")
        self._sleep_until(self._now_s() + self._roll_out_s)
        return result

    def read_now(self) -> Pose:
        """Return the odometry of this moment, as interpolated between its messages."""
        return self._base.read(self._measured)

    def hold(self, command: Command) -> Touch | None:
        """Command a velocity for one control period outside of a movement; return the present contact."""
        self.touch = None
        self._mover.take_other_command()
        self._command = command
        self._sleep_until(self._now_s() + CONTROL_PERIOD_S)
        return self.touch

    def _now_s(self) -> float:
        return self._base.physics.time_s

    def _send(self, command: Command) -> None:
        self._command = command

    def _sleep_until(self, due_s: float) -> None:
        while self._now_s() < due_s - 1e-9:
            self.touch = self._base.drive(self._command) or self.touch
            measured, now_s = self._base.measure(), self._now_s()
            self.path_m += measured.distance_to(self._measured)
            self._measured = measured
            if now_s >= self._due_s - CONTROL_PERIOD_S / 2:
                self._due_s = max(self._due_s + self._period_s, now_s)
                self.reading, self.reading_s = self._base.read(measured), now_s
                heading_rad = math.remainder(self.reading.heading_rad, math.tau)
                self._mover.take_odometry(*self.reading.position, heading_rad, now_s)
