"""Physics of the simulator: a base among the scene's solid primitives, in MuJoCo.

The base is a round shell on two driven wheels and two frictionless casters. A base without wheels, such as one on legs,
moves on two wheels within its shell: its gait is in `BaseDynamics`. Wheels can slip, so wheel rotation and true motion
differ as on a real robot. Contact of the shell with a solid is detected within one step of 2 ms.
"""

import ctypes
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from vsnbench.control.command import Command
from vsnbench.simulator.dynamics.clearance import SolidDistances
from vsnbench.simulator.primitives import Primitive, Scene, Shape
from vsnbench.values.pose import Pose, wrap_angle
from vsnbench.values.robot_profile import Base

STEP_S = 0.002
CONTROL_PERIOD_S = 0.02
_STEPS_PER_PERIOD = round(CONTROL_PERIOD_S / STEP_S)
_GROUND_CLEARANCE_M = 0.03
"""Height of the shell's underside: the base drives over lower objects."""
_WHEEL_RESPONSE_S = 0.01
"""Time constant of the wheels' speed control."""
_STOPPING_STEPS = 100
_INNER_TRACK, _INNER_WHEEL_M = 1.2, 0.035
"""Wheels of a base without wheels: track as a multiple of the shell's radius, and radius of a wheel."""
_NEAR_M = 0.02
"""Solids nearer than this to the shell are simulated."""
_BUILT_IN = frozenset({"floor", "ceiling"})
_EDITION = 3
"""Increased when the pixels or the motion of the same trial change."""


def simulator_version() -> str:
    """Return the edition of the simulator and the version of MuJoCo; trajectories depend on both."""
    import mujoco

    return f"{_EDITION} (mujoco {mujoco.__version__})"


@dataclass(frozen=True, slots=True)
class Touch:
    """A contact of the shell: 1-based index of the site's object, or 0 for the building."""

    instance: int
    category: str
    bearing_rad: float
    """Position on the shell, counter-clockwise from straight ahead."""


class WheelAngles(NamedTuple):
    """Rotation of each wheel, radians, positive forward; a tuple for speed."""

    left_rad: float
    right_rad: float


class Physics:
    """One base in one scene; time passes only in `drive` and `stop`.

    Bit-identical from run to run on one machine type: it uses no clock, no thread and no random numbers.
    """

    def __init__(self, scene: Scene, base: Base) -> None:
        import mujoco

        self._mujoco = mujoco
        _stop_profiling()
        self._base = base
        self._top_m_s, self._top_rad_s = base.max_linear_m_s, base.max_angular_rad_s
        solids = [part for part in scene.primitives if part.solid and part.category not in _BUILT_IN]
        self._clearance = SolidDistances(solids, _GROUND_CLEARANCE_M, base.height_m)
        self._open = _World(mujoco.MjModel.from_xml_string(_world_xml([], base)))
        self._furnished = _World(mujoco.MjModel.from_xml_string(_world_xml(self._clearance.solids, base)))
        self._world = self._open
        self._free_m = 0.0
        self._shell = self._furnished.model.geom("shell").id if self._clearance.solids else -1
        self._first_solid = self._furnished.model.geom("solid0").id if self._clearance.solids else 0
        wheels = [self._open.model.joint(f"{side}_wheel") for side in ("left", "right")]
        self._wheel_angle = [int(wheel.qposadr[0]) for wheel in wheels]
        self.track_m, self._resting_height_m = _wheels_of(base)
        """Distance between the wheels."""
        self.rolling_radius_m = self._calibrated()

    @property
    def time_s(self) -> float:
        """Simulated time since the last placement, seconds."""
        return float(self._world.data.time)

    @property
    def pose(self) -> Pose:
        """True pose of the base in the site's frame; the heading is in (-pi, pi]."""
        x, y, _, w, i, j, k = self._world.data.qpos[:7].tolist()
        return Pose(x, y, math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k)))

    @property
    def wheel_angles(self) -> WheelAngles:
        """Readings of the wheel encoders; zero at the last placement."""
        left, right = self._wheel_angle
        positions = self._world.positions
        return WheelAngles(float(positions[left]), float(positions[right]))

    def place(self, pose: Pose) -> None:
        """Place the base at rest at `pose`; set time and wheel angles to zero."""
        self._world, self._free_m = self._furnished, 0.0
        data = self._world.data
        self._mujoco.mj_resetData(self._world.model, data)
        quaternion = (math.cos(pose.heading_rad / 2), 0.0, 0.0, math.sin(pose.heading_rad / 2))
        data.qpos[:7] = (*pose.position, self._resting_height_m, *quaternion)
        self._mujoco.mj_forward(self._world.model, data)

    def drive(self, command: Command) -> Touch | None:
        """Hold a velocity, limited to the base's maximum, for one control period.

        A new contact stops the wheels for the rest of the period.

        Returns:
            The present contact, or None.
        """
        forward_m_s = min(max(command.linear_m_s, -self._top_m_s), self._top_m_s)
        turning_m_s = min(max(command.angular_rad_s, -self._top_rad_s), self._top_rad_s) * self.track_m / 2
        self._choose_world()
        step, model, data, wheels = self._mujoco.mj_step, self._world.model, self._world.data, self._world.wheels
        wheels[0] = (forward_m_s - turning_m_s) / self.rolling_radius_m
        wheels[1] = (forward_m_s + turning_m_s) / self.rolling_radius_m
        if self._world is self._open:
            step(model, data, _STEPS_PER_PERIOD)
            return None
        new: Touch | None = None
        watching = self.touch() is None
        for _ in range(_STEPS_PER_PERIOD):
            step(model, data)
            if watching and (new := self.touch()):
                watching = False
                wheels[:] = 0.0
        return new or self.touch()

    def slide(self, left_m: float) -> None:
        """Displace the base to its left without turning its wheels."""
        heading_rad = self.pose.heading_rad
        self._free_m -= abs(left_m)
        position = self._world.data.qpos
        position[0] -= left_m * math.sin(heading_rad)
        position[1] += left_m * math.cos(heading_rad)

    def stop(self) -> None:
        """Brake to a standstill."""
        self._world.wheels[:] = 0.0
        self._mujoco.mj_step(self._world.model, self._world.data, _STOPPING_STEPS)

    def touch(self) -> Touch | None:
        """Return the first contact of the shell, or None."""
        if self._world is self._open:
            return None
        contacts = self._world.data.contact
        for number, pair in enumerate(contacts.geom.tolist()):
            if self._shell not in pair:
                continue
            solid = self._clearance.solids[sum(pair) - self._shell - self._first_solid]
            x, y, _ = contacts.pos[number].tolist()
            here = self.pose
            bearing_rad = wrap_angle(math.atan2(y - here.y_m, x - here.x_m) - here.heading_rad)
            return Touch(solid.instance, solid.category, bearing_rad)
        return None

    def _choose_world(self) -> None:
        """Simulate the world without solids while none is near: the result is the same, and it is faster."""
        self._free_m -= self._top_m_s * CONTROL_PERIOD_S
        if self._free_m > 0:
            return
        here = self.pose
        self._free_m = self._clearance.distance_m(here.x_m, here.y_m) - self._base.radius_m - _NEAR_M
        world = self._furnished if self._free_m <= 0 else self._open
        if world is not self._world:
            everything = self._mujoco.mjtState.mjSTATE_INTEGRATION
            state = np.empty(self._mujoco.mj_stateSize(world.model, everything))
            self._mujoco.mj_getState(self._world.model, self._world.data, state, everything)
            self._mujoco.mj_setState(world.model, world.data, state, everything)
            self._mujoco.mj_forward(world.model, world.data)
            self._world = world

    def _calibrated(self) -> float:
        """Let the base settle on a free floor, and return the measured rolling radius of its wheels, metres."""
        model, data = self._open.model, self._open.data
        self._mujoco.mj_step(model, data, 1000)
        self._resting_height_m = float(data.qpos[2])
        return self._resting_height_m - float(data.contact.pos[:, 2].mean())


@cache
def _stop_profiling() -> None:
    """Disable MuJoCo's internal timing, which takes a tenth of a step.

    The Python package enables it on import, and its own function `set_mjcb_time(None)` does not disable it. This sets
    the C library's variable `mjcb_time` instead; `mujoco-core` is pinned, and a test checks the effect.
    """
    import mujoco

    for library in Path(mujoco.__file__).parent.glob("libmujoco.so*"):
        ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time").value = None


class _World:
    """A MuJoCo model and its state."""

    def __init__(self, model: Any) -> None:
        import mujoco

        self.model = model
        self.data: Any = mujoco.MjData(model)
        # Views of MuJoCo's memory, which does not move: creating a view costs more than reading it.
        self.positions: Any = self.data.qpos
        self.wheels: Any = self.data.ctrl


def _wheels_of(base: Base) -> tuple[float, float]:
    """Return the distance between the simulated wheels, and their radius, metres."""
    if base.track_m is None or base.wheel_radius_m is None:
        return _INNER_TRACK * base.radius_m, _INNER_WHEEL_M
    return base.track_m, base.wheel_radius_m


def _world_xml(solids: list[Primitive], base: Base) -> str:
    """Return the world as MJCF; the base's frame is on the axle, x forward."""
    track, radius = _wheels_of(base)
    half_track = track / 2
    wheel_mass = 0.05 * base.mass_kg
    body_mass = base.mass_kg - 2 * wheel_mass
    caster_radius = radius / 2
    caster_x = base.radius_m * 0.75
    half_shell = (base.height_m - _GROUND_CLEARANCE_M) / 2
    # Half the mass per wheel at its radius, and the wheel's own inertia, divided by the time constant.
    gain = (base.mass_kg / 2 * radius**2) / _WHEEL_RESPONSE_S
    inertia = body_mass * base.radius_m**2 / 2
    wheels = "".join(
        f"""
      <body name="{side}_wheel" pos="0 {sign * half_track} 0">
        <joint name="{side}_wheel" type="hinge" axis="0 1 0"/>
        <geom name="{side}_wheel" type="sphere" size="{radius}" mass="{wheel_mass}"/>
      </body>"""
        for side, sign in (("left", 1), ("right", -1))
    )
    casters = "".join(
        f"""
      <geom name="{end}_caster" type="sphere" size="{caster_radius}" mass="0"
            pos="{sign * caster_x} 0 {caster_radius - radius}"/>"""
        for end, sign in (("front", 1), ("rear", -1))
    )
    shell = f"""
      <geom name="shell" type="cylinder" size="{base.radius_m} {half_shell}"
            pos="0 0 {_GROUND_CLEARANCE_M + half_shell - radius}" contype="0" conaffinity="2" condim="1" mass="0"/>"""
    # No joint has a spring or a damper. With one base, islands and the bounding volume hierarchy cost more than they
    # save.
    alone = "" if solids else 'island="disable" midphase="disable"'
    return f"""
<mujoco>
  <option timestep="{STEP_S}" integrator="implicitfast" cone="elliptic" impratio="10" tolerance="1e-10">
    <flag spring="disable" damper="disable" {alone}/>
  </option>
  <default>
    <default class="solid"><geom contype="2" conaffinity="0" condim="1"/></default>
    <geom contype="0" conaffinity="0"/>
  </default>
  <contact>
    <pair geom1="floor" geom2="front_caster" condim="1" solref="0.02 1"/>
    <pair geom1="floor" geom2="rear_caster" condim="1" solref="0.02 1"/>
    <pair geom1="floor" geom2="left_wheel" condim="3" solref="0.012 1"/>
    <pair geom1="floor" geom2="right_wheel" condim="3" solref="0.012 1"/>
  </contact>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    {"".join(_geom_xml(number, solid) for number, solid in enumerate(solids))}
    <body name="base" pos="0 0 {radius}">
      <freejoint/>
      <inertial pos="0 0 0" mass="{body_mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      {shell if solids else ""}{casters}{wheels}
    </body>
  </worldbody>
  <actuator>
    <velocity joint="left_wheel" kv="{gain}"/>
    <velocity joint="right_wheel" kv="{gain}"/>
  </actuator>
</mujoco>"""


def _geom_xml(number: int, solid: Primitive) -> str:
    """Return one solid as an immovable geom."""
    a, b, c = solid.half_size
    shape = Shape.ELLIPSOID if solid.shape is Shape.LEAF else solid.shape
    size = f"{a} {c}" if solid.shape is Shape.CYLINDER else f"{a} {b} {c}"
    position = " ".join(map(str, solid.centre))
    rotation = " ".join(map(str, solid.rotation))
    return f"""
    <geom name="solid{number}" class="solid" type={quoteattr(shape.value)} size="{size}" pos="{position}"
          quat="{rotation}"/>"""
