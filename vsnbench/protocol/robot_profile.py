"""What kind of robot it is: base, speeds, camera and ROS names. The YAML files live in `vsnbench/robots/profiles`."""

import hashlib
import json
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

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


RosName = Annotated[str, Field(pattern=r"^(/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*)?$")]
"""A topic or service name; empty for what the robot does not have."""


class RosNames(BaseModel):
    """The ROS topics and services of this robot; an empty name means the robot does not have it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    command: RosName = Field(default="/cmd_vel", min_length=1)
    odometry: RosName = Field(default="/odom", min_length=1)
    reset_odometry: RosName = ""
    bumper: RosName = ""
    bumper_type: Literal["kobuki_msgs/BumperEvent", "std_msgs/Bool"] = "kobuki_msgs/BumperEvent"
    cliff: RosName = ""
    cliff_type: Literal["kobuki_msgs/CliffEvent", "std_msgs/Bool"] = "kobuki_msgs/CliffEvent"
    wheel_drop: RosName = ""
    wheel_drop_type: Literal["kobuki_msgs/WheelDropEvent", "std_msgs/Bool"] = "kobuki_msgs/WheelDropEvent"
    color: RosName = Field(default="/camera/color/image_raw", min_length=1)
    color_info: RosName = "/camera/color/camera_info"
    depth: RosName = "/camera/depth/image_raw"
    depth_info: RosName = "/camera/depth/camera_info"
    discrete_move: RosName = Field(default="/discrete_move", min_length=1)
    camera_rate_hz: float = Field(default=30.0, gt=0, le=240)
    depth_frames: int = Field(default=10, ge=1, le=100, description="depth images of one median (paper, vsn.yaml)")
    command_timeout_s: float = Field(
        default=0.6, gt=0, le=60, description="the base stands still when it hears no command for this long"
    )


class RobotProfile(BaseModel):
    """One kind of robot, complete."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    title: str
    base: Base
    speeds: Speeds = Field(default_factory=Speeds)
    camera: Camera
    ros: RosNames = Field(default_factory=RosNames)

    def content(self) -> dict[str, Any]:
        """Return the profile as plain values, every default filled in."""
        return self.model_dump(mode="json")

    @cached_property
    def sha256(self) -> str:
        """Hash of the content, independent of comments, formatting and the file's name."""
        text = json.dumps(self.content(), sort_keys=True, ensure_ascii=False, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()
