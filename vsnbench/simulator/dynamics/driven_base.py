"""A base in the physics with its motors and its odometry: what it makes of a command, and what it reports.

Every property of a base that is not ideal (`BaseDynamics`) takes effect here, for the robot in this process and for the
one on the topics of ROS.
"""

import math
import time
from collections import deque

import numpy as np

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.simulator.dynamics.noise import OdometryDrift, OdometryNoise
from vsnbench.simulator.dynamics.odometry import WheelOdometry
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, Physics, Touch
from vsnbench.simulator.primitives import Scene
from vsnbench.values.pose import LEVEL, Attitude, Pose, advanced
from vsnbench.values.robot_profile import IDEAL_BASE, Base, BaseDynamics

_GAIT_START_S = 0.15
"""Time constant with which the sway of a gait begins and ends."""
_WALKING_M_S = 0.01
_WALKS = 0.5
"""Share of the gait from which a body leaves or takes the attitude in which it rests."""


class DrivenBase:
    """One base in one scene; time passes only in `drive`. Bit-identical from run to run for the same seed.

    Attributes:
        is_real_time: whether `drive` waits, so that motion takes as long as on a real base.
    """

    def __init__(
        self, scene: Scene, base: Base, dynamics: BaseDynamics = IDEAL_BASE, noise: OdometryNoise | None = None
    ) -> None:
        self.physics = Physics(scene, base)
        self._dynamics = dynamics
        self._noise = noise
        self._is_ideal = not dynamics.conditions and not base.max_lateral_m_s
        lateral_m_s = base.max_lateral_m_s or dynamics.max_lateral_m_s
        self._motors = Motors(dynamics, lateral_m_s, self.physics.track_m)
        self.is_real_time = False
        self._due_s = 0.0
        self._trail: deque[tuple[Pose, Attitude]] = deque(maxlen=0)

    def place(self, pose: Pose, rng: np.random.Generator) -> None:
        """Put the base down at rest; its odometry begins at zero, with errors from `rng`."""
        self.physics.place(pose)
        self._motors.reset()
        self._wheels = WheelOdometry(self.physics.rolling_radius_m, self.physics.track_m, self._dynamics.encoder_step_m)
        self._drift = OdometryDrift(self._noise, rng) if self._noise is not None else None
        self._rng = rng
        self._gait, self._walking, self._sway_m, self._slid_m = 0.0, 0.0, 0.0, 0.0
        self._rest, self._is_walking = LEVEL, False
        self._come_to_rest()
        self._rolled = self._measured = self._wheels.pose
        self._drifted_rad = self._passed_s = 0.0
        self._trail.clear()

    def keep_trail(self, duration_s: float) -> None:
        """Remember from now on where the base was during the last `duration_s`, for `seen`."""
        self._trail = deque(self._trail, maxlen=math.ceil(duration_s / CONTROL_PERIOD_S - 1e-9))

    def seen(self, ago_s: float) -> tuple[Pose, Attitude]:
        """Return pose and attitude of the base some time ago, within the kept duration and the episode."""
        trail = [*self._trail, (self.physics.pose, self.attitude)]
        place = max(len(trail) - 1 - ago_s / CONTROL_PERIOD_S, 0.0)
        k = min(int(place), len(trail) - 1)
        (a, attitude), (b, _) = trail[k], trail[min(k + 1, len(trail) - 1)]
        share = place - k
        turn_rad = math.remainder(b.heading_rad - a.heading_rad, math.tau)
        x_m, y_m = a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m)
        return Pose(x_m, y_m, a.heading_rad + share * turn_rad), attitude

    def drive(self, command: Command) -> Touch | None:
        """Hold a velocity for one control period; return the present contact, or None."""
        if self.is_real_time:
            self._wait()
        if self._trail.maxlen:
            self._trail.append((self.physics.pose, self.attitude))
        if self._is_ideal:
            return self.physics.drive(command)
        self._passed_s += CONTROL_PERIOD_S
        moving = self._motors.velocity(command)
        turning_rad_s = moving.angular_rad_s * self._dynamics.turn_gain * (1 - self._dynamics.turn_slip)
        aside_m_s = moving.lateral_m_s * self._dynamics.lateral_gain
        touch = self.physics.drive(Command(moving.linear_m_s + self._dynamics.creep * aside_m_s, turning_rad_s))
        self._drifted_rad += math.radians(self._dynamics.heading_drift_deg_s) * CONTROL_PERIOD_S
        left_m = (moving.linear_m_s * self._dynamics.crab + aside_m_s) * CONTROL_PERIOD_S + self._swayed(moving)
        leaves = touch is not None and moving.lateral_m_s * math.sin(touch.bearing_rad) < 0  # away from a contact
        if left_m and (touch is None or leaves):
            self.physics.slide(left_m)
            self._slid_m += left_m
        return touch

    def _wait(self) -> None:
        """Wait until the last period is over. A request to stop interrupts it, before anything has moved."""
        now_s = time.monotonic()
        self._due_s = max(self._due_s, now_s)
        time.sleep(self._due_s - now_s)
        self._due_s += CONTROL_PERIOD_S

    def measure(self) -> Pose:
        """Return the odometry since the base was put down, with an unwrapped heading and without `read`'s noise."""
        rolled = self._wheels.update(self.physics.wheel_angles)
        if not self._is_ideal:
            last, self._rolled = self._rolled, rolled
            turn_rad = rolled.heading_rad - last.heading_rad
            way_m = (rolled.x_m - last.x_m) * math.cos(last.heading_rad + turn_rad / 2) + (
                rolled.y_m - last.y_m
            ) * math.sin(last.heading_rad + turn_rad / 2)
            if abs(turn_rad) < self._dynamics.unmeasured_rad_s * self._passed_s:
                turn_rad = 0.0
            self._passed_s = 0.0
            counted = advanced(self._measured, way_m, turn_rad / (1 - self._dynamics.turn_slip))
            self._measured = rolled = counted.compose(Pose(0.0, self._slid_m))
            self._slid_m = 0.0
        return self._drift.update(rolled) if self._drift is not None else rolled

    def read(self, measured: Pose) -> Pose:
        """Return one reading of a measured pose: with the noise of a reading and the drift of the gyro."""
        position_m, heading_rad = self._dynamics.position_noise_m, math.radians(self._dynamics.heading_noise_deg)
        if not (position_m or heading_rad or self._drifted_rad):
            return measured
        x, y, heading = self._rng.standard_normal(3).tolist()
        return Pose(
            measured.x_m + position_m * x,
            measured.y_m + position_m * y,
            measured.heading_rad + self._drifted_rad + heading_rad * heading,
        )

    @property
    def attitude(self) -> Attitude:
        """Roll and pitch of the body: those of its gait, a roll and two pitches per stride, and those at rest."""
        dynamics, walking = self._dynamics, self._walking
        if not (dynamics.pitch_deg or dynamics.roll_deg or dynamics.lean_deg):
            return LEVEL
        roll_rad = math.radians(dynamics.roll_deg) * math.sin(self._gait)
        pitch_rad = math.radians(dynamics.pitch_deg) * math.sin(2 * self._gait)
        rest = self._rest
        return Attitude(
            walking * roll_rad + (1 - walking) * rest.roll_rad, walking * pitch_rad + (1 - walking) * rest.pitch_rad
        )

    def _come_to_rest(self) -> None:
        """Take a new attitude for the coming rest."""
        if self._dynamics.lean_deg:
            roll, pitch = (math.radians(self._dynamics.lean_deg) * self._rng.standard_normal(2)).tolist()
            self._rest = Attitude(roll, pitch)

    def _swayed(self, moving: Command) -> float:
        """Return the sideways motion of the gait in this period, metres to the left."""
        dynamics = self._dynamics
        if not (dynamics.sway_m or dynamics.pitch_deg or dynamics.roll_deg or dynamics.lean_deg):
            return 0.0
        walks = abs(moving.linear_m_s) + abs(moving.angular_rad_s) + abs(moving.lateral_m_s) > _WALKING_M_S
        self._walking += (walks - self._walking) * CONTROL_PERIOD_S / _GAIT_START_S
        if self._is_walking != (self._walking > _WALKS):
            self._is_walking = not self._is_walking
            if self._is_walking:  # while the attitude at rest has the smaller part
                self._come_to_rest()
        self._gait += math.tau * self._dynamics.sway_hz * CONTROL_PERIOD_S
        before_m, self._sway_m = self._sway_m, self._dynamics.sway_m * self._walking * math.sin(self._gait)
        return self._sway_m - before_m


class Motors:
    """What the motors of a base make of commands: late, sluggish, deaf to slow ones; within the limit sideways.

    Args:
        dynamics: behaviour of the base.
        max_lateral_m_s: limit sideways.
        track_m: distance between the wheels, each of which has the ramp of the driver.
    """

    def __init__(self, dynamics: BaseDynamics, max_lateral_m_s: float = 0.0, track_m: float = 0.0) -> None:
        self._dynamics = dynamics
        self._max_lateral_m_s, self._track_m = max_lateral_m_s, track_m
        delay = dynamics.dead_time_s / CONTROL_PERIOD_S
        self._whole = math.floor(delay + 1e-9)
        self._part = max(delay - self._whole, 0.0)
        self._kept = (
            math.exp(-CONTROL_PERIOD_S / dynamics.motor_time_constant_s) if dynamics.motor_time_constant_s else 0
        )
        self.reset()

    def reset(self) -> None:
        """Stand still, and forget earlier commands."""
        self._commands = deque([STANDSTILL] * (self._whole + 2), maxlen=self._whole + 2)
        self._now = self._ramped = STANDSTILL

    def velocity(self, command: Command) -> Command:
        """Return the mean velocity in the control period that begins with a command."""
        dynamics = self._dynamics
        limit_m_s = self._max_lateral_m_s
        self._commands.append(
            Command(
                _above(command.linear_m_s, dynamics.deadband_m_s),
                _above(command.angular_rad_s, dynamics.deadband_rad_s),
                _above(max(-limit_m_s, min(command.lateral_m_s, limit_m_s)), dynamics.deadband_lateral_m_s),
            )
        )
        due = _blend(self._commands[1], self._commands[0], self._part)
        if dynamics.wheel_acceleration_m_s2:
            due = self._ramped = _nearer(self._ramped, due, dynamics.wheel_acceleration_m_s2, self._track_m)
        if not self._kept:
            return due
        # The mean of an exponential approach over the period, not its value at the end.
        mean_share = dynamics.motor_time_constant_s / CONTROL_PERIOD_S * (1 - self._kept)
        mean = _blend(due, self._now, mean_share)
        self._now = _blend(due, self._now, self._kept)
        return mean


def _above(velocity: float, deadband: float) -> float:
    return velocity if abs(velocity) >= deadband else 0.0


def _nearer(now: Command, wanted: Command, acceleration_m_s2: float, track_m: float) -> Command:
    """Return the velocity after one period in which each wheel approached what is wanted by its ramp."""
    most_m_s = acceleration_m_s2 * CONTROL_PERIOD_S
    wheels = []
    for side in (-1, 1):
        is_m_s, wanted_m_s = (
            velocity.linear_m_s + side * velocity.angular_rad_s * track_m / 2 for velocity in (now, wanted)
        )
        wheels.append(is_m_s + max(-most_m_s, min(wanted_m_s - is_m_s, most_m_s)))
    left_m_s, right_m_s = wheels
    return Command((left_m_s + right_m_s) / 2, (right_m_s - left_m_s) / track_m, wanted.lateral_m_s)


def _blend(one: Command, other: Command, share: float) -> Command:
    """Return the mean of two velocities; `share` is that of the other."""
    return Command(
        (1 - share) * one.linear_m_s + share * other.linear_m_s,
        (1 - share) * one.angular_rad_s + share * other.angular_rad_s,
        (1 - share) * one.lateral_m_s + share * other.lateral_m_s,
    )
