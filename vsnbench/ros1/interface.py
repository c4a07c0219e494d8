"""The interface of a robot profile whose `kind` is `ros1`: the names by which its parts are reached."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_profile import Interface, RobotProfile

RosName = Annotated[str, Field(pattern=r"^(/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*)?$")]
"""A topic or service name; empty for what the robot does not have."""


class Ros1Interface(Interface):
    """Topics and services of a robot on a ROS 1 network; an empty name means that the robot does not have it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["ros1"]
    command: RosName = Field(default="/cmd_vel", min_length=1)
    odometry: RosName = Field(default="/odom", min_length=1)
    reset_odometry: RosName = Field(
        default="", description="what the base offers; vsnbench rebases odometry by itself and never asks for it"
    )
    bumper: RosName = ""
    bumper_type: Literal["kobuki_msgs/BumperEvent", "std_msgs/Bool"] = "kobuki_msgs/BumperEvent"
    cliff: RosName = ""
    cliff_type: Literal["kobuki_msgs/CliffEvent", "std_msgs/Bool"] = "kobuki_msgs/CliffEvent"
    wheel_drop: RosName = ""
    wheel_drop_type: Literal["kobuki_msgs/WheelDropEvent", "std_msgs/Bool"] = "kobuki_msgs/WheelDropEvent"
    battery: RosName = ""
    battery_type: Literal["kobuki_msgs/SensorState", "sensor_msgs/BatteryState"] = "kobuki_msgs/SensorState"
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


def ros1_interface(profile: RobotProfile) -> Ros1Interface:
    """Return how a robot is reached over ROS 1.

    Raises:
        RobotError: its profile says that it is not.
    """
    if isinstance(profile.interface, Ros1Interface):
        return profile.interface
    raise RobotError(
        f"robot profile {profile.name} has {profile.interface.kind if profile.interface else 'no'} interface: "
        "over ROS 1 it needs one of `kind: ros1` (vsnbench robots show turtlebot2)"
    )
