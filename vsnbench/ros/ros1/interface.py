"""Topics and services of a robot profile with `interface.kind: ros1`."""

from types import MappingProxyType
from typing import Annotated, Final, Literal

from pydantic import ConfigDict, Field

from vsnbench.ros.common.interface import SHARED_TOPICS, RosInterface, require_interface
from vsnbench.values.robot_profile import RobotProfile

RosName = Annotated[str, Field(pattern=r"^(/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*)?$")]
"""Name of a topic or service; empty for a part that the robot does not have."""

KOBUKI_STATE: Final = "kobuki_msgs/SensorState"
"""Type of the state of a Kobuki: its battery, and the state of its hazard sensors."""


class Ros1Interface(RosInterface):
    """Topics and services of a robot on a ROS 1 network; an empty name means that the robot does not have the part."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title = "over ROS 1"
    contact_fields = ("bumper",)
    hazard_fields = MappingProxyType({"bumper": "", "cliff": "", "wheel_drop": ""})
    distinct_fields = (*SHARED_TOPICS, "cliff", "wheel_drop", "battery")

    kind: Literal["ros1"]
    command: RosName = Field(default="/cmd_vel", min_length=1)
    odometry: RosName = "/odom"
    reset_odometry: RosName = Field(
        default="", description="topic of the base that resets its odometry; vsnbench does not use it"
    )
    bumper: RosName = ""
    bumper_type: Literal["kobuki_msgs/BumperEvent", "std_msgs/Bool"] = "kobuki_msgs/BumperEvent"
    cliff: RosName = ""
    cliff_type: Literal["kobuki_msgs/CliffEvent", "std_msgs/Bool"] = "kobuki_msgs/CliffEvent"
    wheel_drop: RosName = ""
    wheel_drop_type: Literal["kobuki_msgs/WheelDropEvent", "std_msgs/Bool"] = "kobuki_msgs/WheelDropEvent"
    battery: RosName = ""
    battery_type: Literal["kobuki_msgs/SensorState", "sensor_msgs/BatteryState"] = KOBUKI_STATE
    color: RosName = Field(default="/camera/color/image_raw", min_length=1)
    color_info: RosName = "/camera/color/camera_info"
    depth: RosName = "/camera/depth/image_raw"
    depth_info: RosName = "/camera/depth/camera_info"
    discrete_move: RosName = Field(default="/discrete_move", min_length=1)
    command_timeout_s: float = Field(
        default=0.6, gt=0, le=60, description="time without a command after which the base stops"
    )


def ros1_interface(profile: RobotProfile) -> Ros1Interface:
    """Return the ROS 1 interface of a profile.

    Raises:
        RobotError: the profile has another interface or none.
    """
    return require_interface(profile, "ros1", Ros1Interface, "turtlebot2")
