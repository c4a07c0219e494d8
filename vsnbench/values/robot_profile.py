"""Robot profile: base, speeds, camera, and interface.

The YAML files are in `vsnbench/robots/profiles`.
"""

import hashlib
import json
import shlex
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, SerializeAsAny, model_validator

from vsnbench.values.camera import Camera


class Base(BaseModel):
    """A differential-drive base."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    radius_m: float = Field(gt=0.05, lt=1, description="radius of the round shell, metres")
    height_m: float = Field(gt=0.05, lt=3, description="height of the whole robot, metres")
    mass_kg: float = Field(gt=0.5, lt=200)
    track_m: float = Field(gt=0.05, lt=2, description="distance between the wheels, metres")
    wheel_radius_m: float = Field(gt=0.01, lt=0.5)
    max_linear_m_s: float = Field(gt=0, lt=3)
    max_angular_rad_s: float = Field(gt=0, lt=10)
    odometry_rate_hz: float = Field(gt=0, le=1000)
    has_bumper: bool = True


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


class Interface(BaseModel):
    """Interface of a robot; `kind` is the middleware, whose package defines and checks the other fields."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str


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
    camera: Camera
    interface: SerializeAsAny[Interface] | None = Field(
        default=None, description="none for a robot that is only ever simulated"
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

    @property
    def tolerance_conditions(self) -> dict[str, Any]:
        """The tolerances as a condition of results; empty for the paper's."""
        return {} if self.tolerances is None else {"tolerances": self.tolerances.model_dump(mode="json")}

    def content(self) -> dict[str, Any]:
        """Return the profile as plain values, including defaults."""
        return self.model_dump(mode="json")

    @cached_property
    def sha256(self) -> str:
        """Hash of the content, independent of comments, formatting and the file's name.

        It is computed from the older form, so that it equals the hash in older records.
        """
        content = self.content()
        if self.tolerances is None:
            content.pop("tolerances")
        if self.interface is not None and self.interface.kind == "ros2":
            # The address of one robot, not a property of its kind.
            content["interface"].pop("namespace", None)
        if self.interface is not None and self.interface.kind == "ros1":
            names = content.pop("interface")
            content["ros"] = {name: value for name, value in names.items() if name not in _WITHOUT_EFFECT}
        text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()
