"""Robot profile: base, speeds, camera, and interface.

The YAML files are in `vsnbench/robots/profiles`.
"""

import hashlib
import json
import shlex
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    SerializeAsAny,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.movement import ADAPTER_KINDS, DRIVE_KINDS, ActionKind
from vsnbench.values.observation import MAX_PIXEL_BYTES


class Base(BaseModel):
    """What a base can do: on two driven wheels, or in another way, such as on legs, without the fields of wheels.

    A base without wheels is simulated on two wheels within its shell, see `vsnbench.simulator.dynamics.physics`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    radius_m: float = Field(gt=0.05, lt=1, description="radius of the round shell, metres")
    height_m: float = Field(gt=0.05, lt=3, description="height of the whole robot, metres")
    mass_kg: float = Field(gt=0.5, lt=200)
    track_m: float | None = Field(
        default=None, gt=0.05, lt=2, description="distance between two driven wheels, metres; none without them"
    )
    wheel_radius_m: float | None = Field(default=None, gt=0.01, lt=0.5)
    max_linear_m_s: float = Field(gt=0, lt=3)
    max_angular_rad_s: float = Field(gt=0, lt=10)
    max_lateral_m_s: float = Field(default=0.0, ge=0, lt=3, description="speed limit sideways; 0 if it cannot")
    min_linear_m_s: float = Field(default=0.0, ge=0, lt=3, description="slower commands ahead are never sent, but 0")
    min_angular_rad_s: float = Field(default=0.0, ge=0, lt=10, description="slower turns are never commanded, but 0")
    min_lateral_m_s: float = Field(
        default=0.0, ge=0, lt=3, description="slower commands sideways are never sent, but 0"
    )
    max_acceleration_m_s2: float | None = Field(default=None, gt=0.01, le=20, description="none for no limit")
    max_acceleration_rad_s2: float | None = Field(default=None, gt=0.01, le=100, description="none for no limit")
    dead_time_s: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="time until a command begins to act, where it is known; else it is measured",
    )
    odometry_rate_hz: float = Field(gt=0, le=1000)
    has_bumper: bool = True

    @model_serializer(mode="wrap")
    def _without_later_defaults(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit defaults of fields that older profiles did not have, so that hashes of profiles do not change."""
        content: dict[str, Any] = handler(self)
        fields = type(self).model_fields
        return {name: value for name, value in content.items() if name not in _LATER or value != fields[name].default}

    @model_validator(mode="after")
    def _with_whole_wheels(self) -> Self:
        if (self.track_m is None) != (self.wheel_radius_m is None):
            missing = "track_m" if self.track_m is None else "wheel_radius_m"
            raise ValueError(
                f"{missing} is missing: give track_m and wheel_radius_m of two driven wheels, or neither for a base "
                "without them"
            )
        if self.track_m is not None and self.max_lateral_m_s:
            raise ValueError(
                f"max_lateral_m_s: a base on two driven wheels (track_m {self.track_m:g}) cannot move sideways: leave "
                "out the lateral limits; or the wheels, if it is on legs or omnidirectional wheels"
            )
        for axis in ("linear_m_s", "angular_rad_s", "lateral_m_s"):
            least, limit = getattr(self, f"min_{axis}"), getattr(self, f"max_{axis}")
            if least and least >= limit:
                raise ValueError(f"min_{axis}: {least:g} is not below max_{axis}, which is {limit:g}")
        return self


_LATER = frozenset(
    {"max_lateral_m_s", "min_linear_m_s", "min_angular_rad_s", "min_lateral_m_s", "dead_time_s"}
    | {"max_acceleration_m_s2", "max_acceleration_rad_s2"}
)
"""Fields of a base that older profiles did not have."""


class Speeds(BaseModel):
    """Speeds of discrete_move for this base (paper, Table 1)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    linear_m_s: float = Field(default=0.3, gt=0, lt=3)
    angular_rad_s: float = Field(default=0.5, gt=0, lt=10)
    acceleration_share: float = Field(default=1 / 3, gt=0, le=0.5, description="share of the way spent accelerating")


class Tolerances(BaseModel):
    """Tolerances of movements, for a base whose odometry is too noisy for the paper's."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    position_m: float = Field(default=0.005, gt=0, le=0.1, description="error of a move, metres")
    turn_deg: float = Field(default=0.1, gt=0, le=10, description="error of a turn, degrees")


class BaseDynamics(BaseModel):
    """Behaviour of a simulated base that differs from an ideal one; the defaults are an ideal base.

    docs/robots.md lists values of real bases with their sources.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    dead_time_s: float = Field(default=0.0, ge=0, le=1, description="time until a command begins to act, seconds")
    motor_time_constant_s: float = Field(
        default=0.0, ge=0, le=1, description="first-order lag of the velocity, seconds"
    )
    wheel_acceleration_m_s2: float | None = Field(
        default=None, gt=0.01, le=20, description="ramp of the driver for each wheel; none for no limit"
    )
    deadband_m_s: float = Field(default=0.0, ge=0, lt=3, description="slower forward commands do not move the base")
    deadband_rad_s: float = Field(default=0.0, ge=0, lt=10, description="slower turns do not turn the base")
    deadband_lateral_m_s: float = Field(default=0.0, ge=0, lt=3, description="slower commands sideways do not move it")
    turn_slip: float = Field(
        default=0.0, ge=0, lt=0.9, description="share of a turn that skidding wheels lose unmeasured"
    )
    turn_gain: float = Field(default=1.0, gt=0.2, le=2.5, description="turn per commanded turn, measured")
    crab: float = Field(default=0.0, ge=-0.3, le=0.3, description="metres to the left per metre forward, measured")
    creep: float = Field(default=0.0, ge=-0.3, le=0.3, description="metres forward per metre to the left, measured")
    lateral_gain: float = Field(default=1.0, gt=0.2, le=2.5, description="way sideways per commanded way, measured")
    sway_m: float = Field(default=0.0, ge=0, le=0.1, description="amplitude of a gait's sideways motion, measured")
    sway_hz: float = Field(default=2.0, gt=0, le=10, description="frequency of the gait, Hz")
    pitch_deg: float = Field(
        default=0.0, ge=0, le=15, description="amplitude of a gait's pitch, which moves the camera"
    )
    roll_deg: float = Field(default=0.0, ge=0, le=15, description="amplitude of a gait's roll, which moves the camera")
    lean_deg: float = Field(
        default=0.0, ge=0, le=10, description="standard deviation of roll and pitch in which the body comes to rest"
    )
    max_lateral_m_s: float = Field(
        default=0.0, ge=0, lt=3, description="speed limit sideways, if the base of the profile states none"
    )
    encoder_step_m: float = Field(
        default=0.0, ge=0, le=0.05, description="way of a wheel per encoder count; 0 is exact"
    )
    position_noise_m: float = Field(
        default=0.0, ge=0, le=0.05, description="standard deviation of each reading, metres"
    )
    heading_noise_deg: float = Field(default=0.0, ge=0, le=5, description="standard deviation of each reading, degrees")
    heading_drift_deg_s: float = Field(default=0.0, ge=-5, le=5, description="drift of the gyro, also at rest")
    unmeasured_rad_s: float = Field(default=0.0, ge=0, lt=1, description="slower turns are not measured")
    odometry_rate_hz: float | None = Field(
        default=None, ge=1, le=50, description="rate of the odometry, Hz; none for the profile's"
    )

    @property
    def conditions(self) -> dict[str, Any]:
        """Values that differ from an ideal base, for the conditions of results."""
        return self.model_dump(mode="json", exclude_defaults=True)

    def fault(self, base: Base) -> str:
        """Return why a base cannot behave like this, or an empty string."""
        limits = {"deadband_m_s": base.max_linear_m_s, "deadband_rad_s": base.max_angular_rad_s}
        limits["deadband_lateral_m_s"] = base.max_lateral_m_s or self.max_lateral_m_s
        for name, limit in limits.items():
            if (deadband := getattr(self, name)) >= limit and deadband:
                unit = "m/s" if name.endswith("m_s") else "rad/s"
                return f"{name}: {deadband:g} is not below the base's limit of {limit:g} {unit}"
        return ""


IDEAL_BASE = BaseDynamics()


class Interface(BaseModel):
    """Interface of a robot; `kind` is the middleware, whose package defines and checks the other fields."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str


_BYTES_PER_PIXEL = 7
"""Bytes of a colour and its depth in a message."""
_WITHOUT_EFFECT = ("kind", "battery", "battery_type")
"""Fields of a ROS 1 interface that the older form did not have; they do not affect the robot's behaviour."""


class RobotProfile(BaseModel):
    """Complete profile of a kind of robot."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    title: str
    base: Base
    speeds: Speeds = Field(default_factory=Speeds)
    tolerances: Tolerances | None = Field(
        default=None, description="none for the paper's 5 mm and 0.1 degrees; others are a condition of the campaign"
    )
    camera: Camera = Field(description="the main camera, which looks ahead")
    cameras: Mapping[CameraRole, Camera] = Field(
        default_factory=dict, description="further cameras by role (left, right, rear); models ask for them"
    )
    interface: SerializeAsAny[Interface] | None = Field(
        default=None, description="none for a robot that is only ever simulated"
    )
    dynamics: BaseDynamics | None = Field(
        default=None, description="behaviour of the base in simulation; none for an ideal base"
    )

    _given: str = PrivateAttr(default="")

    def given_as(self, name: str) -> Self:
        """Return the same profile with the name, path or NAME@NAMESPACE by which the user named the robot."""
        profile = self.model_copy()
        profile._given = name  # noqa: SLF001  # of this class
        return profile

    @property
    def argument(self) -> str:
        """The robot as an argument of a printed command: as the user named it, quoted for a shell."""
        namespace = getattr(self.interface, "namespace", "")
        return shlex.quote(self._given or (f"{self.name}@{namespace}" if namespace else self.name))

    def given_in(self, namespace: str) -> str:
        """Return the name on the command line of the same robot in another namespace."""
        without, at, _ = self._given.rpartition("@")
        return f"{(without if at else self._given) or self.name}@{namespace}"

    @model_validator(mode="before")
    @classmethod
    def _from_older_form(cls, content: Any) -> Any:
        """Accept the older form with `ros:` instead of `interface:`."""
        if isinstance(content, Mapping) and "ros" in content and "interface" in content:
            raise ValueError("the profile has both `ros:` and `interface:`: make one profile for each interface")
        if isinstance(content, Mapping) and "ros" in content:
            names = content["ros"]
            content = {key: value for key, value in content.items() if key != "ros"}
            content["interface"] = {"kind": "ros1", **names} if isinstance(names, Mapping) else names
        return content

    @model_validator(mode="after")
    def _with_possible_dynamics(self) -> Self:
        if self.dynamics is not None and (fault := self.dynamics.fault(self.base)):
            raise ValueError(f"dynamics: {fault}")
        for axis in ("linear_m_s", "angular_rad_s"):
            if (speed := getattr(self.speeds, axis)) < (least := getattr(self.base, f"min_{axis}")):
                raise ValueError(f"speeds.{axis}: {speed:g} is below base.min_{axis}, which is {least:g}")
        if not self.camera.is_ahead:
            raise ValueError("camera: the main camera looks ahead; others belong into `cameras`, by role")
        if CameraRole.FRONT in self.cameras:
            raise ValueError("cameras: `front` is the main camera, which stands in `camera`")
        pixels = sum(camera.width * camera.height for camera in (self.camera, *self.cameras.values()))
        if self.cameras and _BYTES_PER_PIXEL * pixels > MAX_PIXEL_BYTES:
            raise ValueError(
                f"cameras: {pixels} pixels together; at most {MAX_PIXEL_BYTES // _BYTES_PER_PIXEL} fit into a message"
            )
        return self

    @property
    def drive_kinds(self) -> frozenset[ActionKind]:
        """Kinds of movements that the base executes."""
        return ADAPTER_KINDS if self.base.max_lateral_m_s else DRIVE_KINDS

    @property
    def tolerance_conditions(self) -> dict[str, Any]:
        """The tolerances as a condition of results; empty for the paper's."""
        return {} if self.tolerances is None else {"tolerances": self.tolerances.model_dump(mode="json")}

    def content(self) -> dict[str, Any]:
        """Return the profile as plain values, including defaults; `cameras` only where there are any."""
        content = self.model_dump(mode="json")
        return content if self.cameras else {name: value for name, value in content.items() if name != "cameras"}

    @cached_property
    def sha256(self) -> str:
        """Hash of the content, independent of comments, formatting and the file's name.

        It is computed from the older form, so that it equals the hash in older records. The dynamics are a condition of
        simulated results instead, because they do not affect the real robot.
        """
        content = self.content()
        content.pop("dynamics")
        if self.tolerances is None:
            content.pop("tolerances")
        if self.interface is not None and self.interface.kind == "ros2":
            # The address of one robot, not a property of its kind.
            content["interface"].pop("namespace", None)
        if self.interface is not None and self.interface.kind == "adapter":
            content["interface"].pop("address", None)
        if self.interface is not None and self.interface.kind == "ros1":
            names = content.pop("interface")
            content["ros"] = {name: value for name, value in names.items() if name not in _WITHOUT_EFFECT}
        text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()
