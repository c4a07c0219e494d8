"""The base's own computer in simulation: commands in, motion of the embedded world, odometry and events out; no ROS.

It behaves as a real base's driver does: a command acts until the next one, or until none has come for a while;
odometry goes on counting when a person picks the robot up and puts it down elsewhere. Resetting it zeroes position
AND heading, some time after it was asked: kobuki_driver (`Kobuki::resetOdometry`) calls the gyro's present angle zero,
too, and the driver's pose follows with the base's next packets of data, some 10 to 30 ms later.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from vsnbench.motion.controller import STANDSTILL, Command
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.simulator.noise import NoiseSettings, OdometryDrift
from vsnbench.simulator.odometry import WheelOdometry
from vsnbench.simulator.physics import CONTROL_PERIOD_S, Physics, Touch
from vsnbench.simulator.primitives import Scene

_FRONT_RAD = math.radians(25)
_BUMPER_RAD = math.radians(95)
"""A Kobuki's bumper covers the front half of the shell: left, centre and right."""


@dataclass(frozen=True, slots=True)
class Contact:
    """What the shell touches, and which part of the bumper feels it: 0 left, 1 centre, 2 right, None behind."""

    name: str
    bumper: int | None


class SimulatedBase:
    """A base of some profile in a site's twin; not thread-safe, time passes in `advance` only."""

    def __init__(
        self,
        site: Site,
        scene: Scene,
        profile: RobotProfile,
        noise: NoiseSettings | None = None,
        command_lag_s: float = 0.0,
        command_timeout_s: float = 0.6,
    ) -> None:
        self._site = site
        self._noise = noise
        self._lag_s = command_lag_s
        self._command_timeout_s = command_timeout_s
        self._physics = Physics(scene, profile.base)
        self._commands: deque[tuple[float, Command]] = deque()
        self._current = STANDSTILL
        self._heard_s = -math.inf
        self._reset_due_s = math.inf
        self._drift: OdometryDrift | None = None
        self._origin = self._counted = Pose(0.0, 0.0, 0.0)
        self.now_s = 0.0
        """Time on the base's clock; it does not go back when the robot is placed."""
        self.put_down(site.starts[0].pose, seed=0)

    @property
    def pose(self) -> Pose:
        """Where the robot truly stands, in the site's frame."""
        return self._physics.pose

    @property
    def odometry(self) -> Pose:
        """Where the base believes to be, in a frame of its own."""
        return self._origin.compose(self._counted)

    @property
    def command(self) -> Command:
        """What the wheels are told now."""
        silent = self.now_s - self._heard_s > self._command_timeout_s
        return STANDSTILL if silent else self._current

    def hear(self, command: Command) -> None:
        """Take a velocity command."""
        self._commands.append((self.now_s + self._lag_s, command))

    def advance(self) -> Contact | None:
        """Let one control period of CONTROL_PERIOD_S pass, and return what the shell touches."""
        while self._commands and self._commands[0][0] <= self.now_s + 1e-9:
            self._heard_s, self._current = self._commands.popleft()
        touch = self._physics.drive(self.command)
        self.now_s += CONTROL_PERIOD_S
        counted = self._wheels.update(self._physics.wheel_angles)
        self._counted = self._drift.update(counted) if self._drift is not None else counted
        if self.now_s >= self._reset_due_s - 1e-9:
            self._reset_due_s = math.inf
            self._origin = Pose(0.0, 0.0).relative_to(self._counted)
        return self._contact_of(touch) if touch else None

    def put_down(self, pose: Pose, seed: int) -> str:
        """Put the robot down at rest, as a person does; returns what it touches there, empty for nothing.

        Odometry does not notice. `seed` starts the errors of the odometry anew.
        """
        self._origin = self.odometry
        self._physics.place(pose)
        self._wheels = WheelOdometry(self._physics.geometry)
        self._counted = self._wheels.pose
        rng = np.random.default_rng(seed)
        self._drift = OdometryDrift(self._noise.odometry, rng) if self._noise is not None else None
        self._commands.clear()
        self._current = STANDSTILL
        touch = self._physics.touch()
        return self._contact_of(touch).name if touch else ""

    def reset_odometry(self) -> None:
        """Ask for position and heading zero; the second period from now is the first to have them."""
        self._reset_due_s = self.now_s + 2 * CONTROL_PERIOD_S

    def _contact_of(self, touch: Touch) -> Contact:
        name = self._site.objects[touch.instance - 1].id if touch.instance else touch.category
        bearing_rad = touch.bearing_rad
        if abs(bearing_rad) > _BUMPER_RAD:
            return Contact(name, None)
        if abs(bearing_rad) <= _FRONT_RAD:
            return Contact(name, 1)
        return Contact(name, 0 if bearing_rad > 0 else 2)
