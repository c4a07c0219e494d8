"""What kind of robot it is: base, speeds, camera, and the interface by which it is spoken to.

The YAML files live in `vsnbench/robots/profiles`.
"""

import hashlib
import json
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, SerializeAsAny, model_validator

from vsnbench.protocol.camera import Camera


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
    """How discrete_move drives this base (paper, Table 1)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    linear_m_s: float = Field(default=0.3, gt=0, lt=3)
    angular_rad_s: float = Field(default=0.5, gt=0, lt=10)
    acceleration_share: float = Field(default=1 / 3, gt=0, le=0.5, description="share of the way spent accelerating")


class Interface(BaseModel):
    """How a robot is spoken to; `kind` says which middleware, whose own room knows and checks the other fields."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str


_NOT_WHAT_IT_IS = ("kind", "battery", "battery_type")
"""Fields of a ROS 1 interface that the older form had not: they change nothing that a robot does."""


class RobotProfile(BaseModel):
    """One kind of robot, complete."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    title: str
    base: Base
    speeds: Speeds = Field(default_factory=Speeds)
    camera: Camera
    interface: SerializeAsAny[Interface] | None = Field(
        default=None, description="none for a robot that is only ever simulated"
    )

    @model_validator(mode="before")
    @classmethod
    def _from_older_form(cls, content: Any) -> Any:
        """Take the form in which files and records had `ros:`, before a profile could have another interface.

        Raises:
            ValueError: the profile has both forms.
        """
        if isinstance(content, Mapping) and "ros" in content and "interface" in content:
            raise ValueError(
                "it has both `ros:` and `interface:`: a robot is reached by one of them; keep a profile for each"
            )
        if isinstance(content, Mapping) and "ros" in content:
            names = content["ros"]
            content = {key: value for key, value in content.items() if key != "ros"}
            content["interface"] = {"kind": "ros1", **names} if isinstance(names, Mapping) else names
        return content

    def content(self) -> dict[str, Any]:
        """Return the profile as plain values, every default filled in."""
        return self.model_dump(mode="json")

    @cached_property
    def sha256(self) -> str:
        """Hash of the content, independent of comments, formatting and the file's name.

        Taken of the older form, so that a record knows a robot again that it knew by then.
        """
        content = self.content()
        if self.interface is not None and self.interface.kind == "ros2":
            # Where this one robot is reached, not what it is.
            content["interface"].pop("namespace", None)
        if self.interface is not None and self.interface.kind == "ros1":
            names = content.pop("interface")
            content["ros"] = {name: value for name, value in names.items() if name not in _NOT_WHAT_IT_IS}
        text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()
