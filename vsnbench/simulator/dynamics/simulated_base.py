"""Simulated base with the behaviour of a base's driver: commands in, odometry and contacts out; no ROS.

A command acts until the next command or until a timeout. Odometry is not affected when the robot is carried elsewhere.
A reset zeroes position AND heading after a delay: kobuki_driver (`Kobuki::resetOdometry`) also zeroes the gyro's angle,
and the driver's pose follows with the base's next data packets, about 10 to 30 ms later.
"""

import math
from dataclasses import dataclass

import numpy as np

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.simulator.dynamics.driven_base import DrivenBase
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, Touch
from vsnbench.simulator.primitives import Scene
from vsnbench.sites.site import Site
from vsnbench.values.pose import Attitude, Pose
from vsnbench.values.robot_profile import IDEAL_BASE, BaseDynamics, RobotProfile

_FRONT_RAD = math.radians(25)
_BUMPER_RAD = math.radians(95)
"""A Kobuki's bumper covers the front half of the shell: left, centre and right."""


@dataclass(frozen=True, slots=True)
class Contact:
    """Object in contact, and part of the bumper: 0 left, 1 centre, 2 right, None behind."""

    name: str
    bumper: int | None


class SimulatedBase:
    """A base of a profile in a simulated site; not thread-safe, time passes only in `advance`."""

    def __init__(
        self,
        site: Site,
        scene: Scene,
        profile: RobotProfile,
        noise: NoiseSettings | None = None,
        dynamics: BaseDynamics = IDEAL_BASE,
        command_timeout_s: float = 0.6,
    ) -> None:
        self._site = site
        self._command_timeout_s = command_timeout_s
        self._driven = DrivenBase(scene, profile.base, dynamics, None if noise is None else noise.odometry)
        self._current = STANDSTILL
        self._commanded_s = -math.inf
        self._reset_due_s = math.inf
        self._origin = self._counted = Pose(0.0, 0.0, 0.0)
        self.now_s = 0.0
        """Time on the base's clock; a placement does not reset it."""
        self.put_down(site.starts[0].pose, seed=0)

    @property
    def pose(self) -> Pose:
        """True pose of the robot in the site's frame."""
        return self._driven.physics.pose

    @property
    def attitude(self) -> Attitude:
        """True roll and pitch of the body."""
        return self._driven.attitude

    @property
    def odometry(self) -> Pose:
        """Pose by odometry, in the odometry's frame, without the noise of a reading."""
        return self._origin.compose(self._counted)

    def read_odometry(self) -> Pose:
        """Return one reading of the odometry."""
        return self._driven.read(self.odometry)

    @property
    def command(self) -> Command:
        """Command that the driver passes to the motors now."""
        silent = self.now_s - self._commanded_s > self._command_timeout_s
        return STANDSTILL if silent else self._current

    def set_command(self, command: Command) -> None:
        """Accept a velocity command."""
        self._commanded_s, self._current = self.now_s, command

    def advance(self) -> Contact | None:
        """Advance by one control period of CONTROL_PERIOD_S; return the present contact."""
        touch = self._driven.drive(self.command)
        self.now_s += CONTROL_PERIOD_S
        self._counted = self._driven.measure()
        if self.now_s >= self._reset_due_s - 1e-9:
            self._reset_due_s = math.inf
            self._origin = Pose(0.0, 0.0).relative_to(self._counted)
        return self._contact_of(touch) if touch else None

    def put_down(self, pose: Pose, seed: int) -> str:
        """Place the robot at rest; return what it touches there, or an empty string.

        Odometry does not change. `seed` restarts the errors of the odometry.
        """
        self._origin = self.odometry
        self._driven.place(pose, np.random.default_rng(seed))
        self._counted = Pose(0.0, 0.0, 0.0)
        self._current = STANDSTILL
        touch = self._driven.physics.touch()
        return self._contact_of(touch).name if touch else ""

    def reset_odometry(self) -> None:
        """Request zero odometry; it takes effect in the second period from now."""
        self._reset_due_s = self.now_s + 2 * CONTROL_PERIOD_S

    def _contact_of(self, touch: Touch) -> Contact:
        name = self._site.objects[touch.instance - 1].id if touch.instance else touch.category
        bearing_rad = touch.bearing_rad
        if abs(bearing_rad) > _BUMPER_RAD:
            return Contact(name, None)
        if abs(bearing_rad) <= _FRONT_RAD:
            return Contact(name, 1)
        return Contact(name, 0 if bearing_rad > 0 else 2)
