"""The embedded world's physics: a differential-drive base among the scene's solid primitives, in MuJoCo.

The base is a round shell on two driven wheels and two frictionless casters. Wheels can slip, so wheel rotation and
true motion differ honestly. Contact of the shell with anything solid is noticed within one step of 2 ms.
"""

import math
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

from vsnbench.motion.controller import Command
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import Base
from vsnbench.simulator.primitives import Primitive, Scene, Shape

STEP_S = 0.002
CONTROL_PERIOD_S = 0.02
_STEPS_PER_PERIOD = round(CONTROL_PERIOD_S / STEP_S)
_CLEARANCE_M = 0.03
"""The shell's underside: lower things are driven over, or under."""
_WHEEL_RESPONSE_S = 0.01
"""Time constant of the wheels' speed control."""
_TOP_SPEED_SLACK = 1.05
_BUILDING = frozenset({"floor", "ceiling"})


@dataclass(frozen=True, slots=True)
class Touch:
    """What the shell touched: the 1-based index of the site's object, or 0 for a part of the building."""

    instance: int
    category: str
    bearing_rad: float
    """Where on the shell, counter-clockwise from straight ahead."""


@dataclass(frozen=True, slots=True)
class WheelAngles:
    """How far each wheel has turned, radians; forward is positive."""

    left_rad: float
    right_rad: float


@dataclass(frozen=True, slots=True)
class RollingGeometry:
    """What turns wheel angles into motion: the wheels' rolling radius and their distance."""

    radius_m: float
    track_m: float


class Physics:
    """One base in one scene; time passes only in `drive`.

    Bit-identical from run to run on one machine type: no clock, no thread, no randomness.
    """

    def __init__(self, scene: Scene, base: Base) -> None:
        import mujoco

        self._mujoco = mujoco
        self._base = base
        solids = [p for p in scene.primitives if p.solid and p.category not in _BUILDING]
        self._model = mujoco.MjModel.from_xml_string(_world_xml(solids, base))
        self._data: Any = mujoco.MjData(self._model)
        self._touchable = {self._model.geom(f"solid{k}").id: solid for k, solid in enumerate(solids)}
        self._shell = self._model.geom("shell").id
        wheels = [self._model.joint(f"{side}_wheel") for side in ("left", "right")]
        self._wheel_angle = [int(wheel.qposadr[0]) for wheel in wheels]
        self._place_height_m = 0.0
        self.touch: Touch | None = None
        self.geometry = self._rest()

    @property
    def time_s(self) -> float:
        """Simulated time since the base was placed."""
        return float(self._data.time)

    @property
    def pose(self) -> Pose:
        """Where the base truly is, in the site's frame; the heading is in (-pi, pi]."""
        x, y, _, w, i, j, k = self._data.qpos[:7].tolist()
        return Pose(x, y, math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k)))

    @property
    def wheel_angles(self) -> WheelAngles:
        """What the wheels' encoders read; zero where the base was placed."""
        left, right = self._wheel_angle
        return WheelAngles(float(self._data.qpos[left]), float(self._data.qpos[right]))

    def place(self, pose: Pose) -> None:
        """Put the base down at `pose`, at rest, with time and wheel angles at zero."""
        self._mujoco.mj_resetData(self._model, self._data)
        half = pose.heading_rad / 2
        self._data.qpos[:7] = [pose.x_m, pose.y_m, self._place_height_m, math.cos(half), 0.0, 0.0, math.sin(half)]
        self.touch = None
        self._mujoco.mj_forward(self._model, self._data)
        self._look_for_touch()

    def drive(self, command: Command) -> Touch | None:
        """Hold a velocity for one control period; ends early, with the wheels stopped dead, at a touch.

        Returns:
            What was touched, the first time it is; None while the way is free.
        """
        half_track_m, radius_m = self.geometry.track_m / 2, self.geometry.radius_m
        left = (command.linear_m_s - command.angular_rad_s * half_track_m) / radius_m
        right = (command.linear_m_s + command.angular_rad_s * half_track_m) / radius_m
        control = self._data.ctrl
        control[0], control[1] = left, right
        step, model, data = self._mujoco.mj_step, self._model, self._data
        for _ in range(_STEPS_PER_PERIOD):
            step(model, data)
            if data.ncon > 4 and self._look_for_touch():
                control[:] = 0.0
                break
        return self.touch

    def _look_for_touch(self) -> bool:
        """Remember the first thing that the shell is in contact with."""
        self.touch = None
        for contact in range(self._data.ncon):
            one, other = self._data.contact.geom[contact].tolist()
            if self._shell not in (one, other):
                continue
            solid = self._touchable[one if other == self._shell else other]
            here = self.pose
            x, y, _ = self._data.contact.pos[contact].tolist()
            bearing_rad = math.remainder(math.atan2(y - here.y_m, x - here.x_m) - here.heading_rad, math.tau)
            self.touch = Touch(solid.instance, solid.category, bearing_rad)
            return True
        return False

    def _rest(self) -> RollingGeometry:
        """Let the base sink into its springs far from everything, and calibrate it there as one does a real robot."""
        self._place_height_m = self._base.wheel_radius_m
        self.place(Pose(1000.0, 1000.0))
        for _ in range(1000):
            self._mujoco.mj_step(self._model, self._data)
        self._place_height_m = float(self._data.qpos[2])
        contact_height_m = float(self._data.contact.pos[:, 2].mean())
        return RollingGeometry(self._place_height_m - contact_height_m, self._base.track_m)


def _world_xml(solids: list[Primitive], base: Base) -> str:
    """Return the world as MJCF; the base's frame is on the axle, x forward."""
    radius, half_track = base.wheel_radius_m, base.track_m / 2
    wheel_mass = 0.05 * base.mass_kg
    body_mass = base.mass_kg - 2 * wheel_mass
    caster_radius = radius / 2
    caster_x = base.radius_m * 0.75
    half_shell = (base.height_m - _CLEARANCE_M) / 2
    # Half the mass per wheel at its radius, and the wheel's own inertia, over the wanted time constant.
    gain = (base.mass_kg / 2 * radius**2) / _WHEEL_RESPONSE_S
    top = (base.max_linear_m_s + base.max_angular_rad_s * half_track) / radius * _TOP_SPEED_SLACK
    inertia = body_mass * base.radius_m**2 / 2
    wheels = "".join(
        f"""
      <body name="{side}_wheel" pos="0 {sign * half_track} 0">
        <joint name="{side}_wheel" type="hinge" axis="0 1 0"/>
        <geom type="sphere" size="{radius}" mass="{wheel_mass}" class="wheel"/>
      </body>"""
        for side, sign in (("left", 1), ("right", -1))
    )
    casters = "".join(
        f"""
      <geom type="sphere" size="{caster_radius}" pos="{sign * caster_x} 0 {caster_radius - radius}" mass="0"
            class="caster"/>"""
        for sign in (1, -1)
    )
    return f"""
<mujoco>
  <option timestep="{STEP_S}" integrator="implicitfast" cone="elliptic" impratio="10" tolerance="1e-10"/>
  <size memory="4M"/>
  <default>
    <default class="solid"><geom contype="2" conaffinity="0" condim="1"/></default>
    <default class="wheel"><geom contype="0" conaffinity="1" condim="3" friction="1 0 0" solref="0.004 1"/></default>
    <default class="caster"><geom contype="0" conaffinity="1" condim="1" solref="0.02 1"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="0" condim="1"/>
    {"".join(_geom_xml(number, solid) for number, solid in enumerate(solids))}
    <body name="base" pos="0 0 {radius}">
      <freejoint/>
      <inertial pos="0 0 0" mass="{body_mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom name="shell" type="cylinder" size="{base.radius_m} {half_shell}"
            pos="0 0 {_CLEARANCE_M + half_shell - radius}" contype="0" conaffinity="2" condim="1" mass="0"/>
      {casters}{wheels}
    </body>
  </worldbody>
  <actuator>
    <velocity joint="left_wheel" kv="{gain}" ctrlrange="{-top} {top}" ctrllimited="true"/>
    <velocity joint="right_wheel" kv="{gain}" ctrlrange="{-top} {top}" ctrllimited="true"/>
  </actuator>
</mujoco>"""


def _geom_xml(number: int, solid: Primitive) -> str:
    """Return one solid as an immovable geom."""
    a, b, c = solid.half_size
    size = f"{a} {c}" if solid.shape is Shape.CYLINDER else f"{a} {b} {c}"
    position = " ".join(map(str, solid.centre))
    rotation = " ".join(map(str, solid.rotation))
    return f"""
    <geom name="solid{number}" class="solid" type={quoteattr(solid.shape.value)} size="{size}" pos="{position}"
          quat="{rotation}"/>"""
