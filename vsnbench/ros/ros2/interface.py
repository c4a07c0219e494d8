"""Topics of a robot profile with `interface.kind: ros2`."""

from dataclasses import replace
from types import MappingProxyType
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field

from vsnbench.errors import RobotError
from vsnbench.ros.common.hazard_topics import HazardTopic
from vsnbench.ros.common.interface import SHARED_TOPICS, RosInterface, require_interface
from vsnbench.ros.ros2.installation import irobot_type, type_of
from vsnbench.values.robot_profile import RobotProfile

RosName = Annotated[str, Field(pattern=r"^(/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?$")]
"""Name of a topic, relative to the robot's namespace unless it begins with a slash; empty for a missing part."""
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
VELOCITIES = (TWIST, TWIST_STAMPED)
"""Types of velocity commands."""
_IROBOT = "irobot_create_msgs"


class Ros2Interface(RosInterface):
    """Topics of a robot on a ROS 2 graph; an empty name means that the robot does not have the part."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title = "over ROS 2"
    contact_fields = ("bumper", "hazards")
    hazard_fields = MappingProxyType({"bumper": "std_msgs/Bool", "hazards": f"{_IROBOT}/HazardDetectionVector"})
    distinct_fields = (*SHARED_TOPICS, "hazards", "battery", "dock")

    kind: Literal["ros2"]
    namespace: RosName = Field(default="", description="namespace of this robot; not part of the profile's hash")
    command: RosName = Field(
        default="cmd_vel", description="velocities; empty for a robot that only a motion adapter at discrete_move moves"
    )
    command_type: Literal["", "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"] = Field(
        default="", description="type of velocities; empty for the type to which the base subscribes"
    )
    odometry: RosName = "odom"
    color: RosName = Field(default="camera/color/image_raw", min_length=1)
    color_info: RosName = "camera/color/camera_info"
    depth: RosName = "camera/depth/image_raw"
    depth_info: RosName = "camera/depth/camera_info"
    image_turns: int = Field(default=0, ge=0, le=3, description="clockwise quarter turns that set an image upright")
    hazards: RosName = Field(default="", description="irobot_create_msgs/msg/HazardDetectionVector")
    bumper: RosName = Field(default="", description="std_msgs/msg/Bool, true while pressed")
    battery: RosName = Field(default="", description="sensor_msgs/msg/BatteryState")
    dock: RosName = Field(default="", description="irobot_create_msgs/msg/DockStatus")
    undock: RosName = Field(default="", description="action irobot_create_msgs/action/Undock")
    discrete_move: RosName = Field(
        default="discrete_move", description="name of the node on the robot; without it the workstation steers"
    )
    command_timeout_s: float = Field(
        default=0.5, gt=0, le=60, description="time without a command after which the base stops"
    )

    @property
    def hazard_topics(self) -> tuple[HazardTopic, ...]:
        """Topics of the hazard sensors that the base has."""
        start = "start its driver, on a TurtleBot 4 by hazard_detection in republisher.yaml"
        vector = irobot_type("msg", "HazardDetectionVector")
        of_irobot = {"start": start, **({"missing_package": _IROBOT} if vector is None else {"kind": type_of(vector)})}
        return tuple(replace(part, **of_irobot) if part.field == "hazards" else part for part in super().hazard_topics)

    def resolve(self, name: str) -> str:
        """Return the full name of a topic; an empty name stays empty."""
        if not name or name.startswith("/"):
            return name
        return f"{self.root}/{name}"

    def simulation_topic(self, topic: str) -> str:
        """Return the full name of a topic of `sensing.simulation` for this robot."""
        return self.resolve(topic.lstrip("/"))

    @property
    def root(self) -> str:
        """The namespace with a leading slash, or an empty string."""
        return f"/{self.namespace.strip('/')}" if self.namespace.strip("/") else ""

    def type_name(self, kind: str) -> str:
        """Return the name of a type such as `sensor_msgs/Image` in ROS 2."""
        return kind.replace("/", "/msg/")

    def resolved(self) -> Self:
        """Return the interface with full names."""
        names: dict[str, Any] = {part: self.resolve(getattr(self, part)) for part in _PARTS}
        if self.tf is not None:
            names["tf"] = self.tf.model_copy(update={"topic": self.resolve(self.tf.topic)})
        if self.attitude is not None:
            names["attitude"] = self.attitude.model_copy(update={"topic": self.resolve(self.attitude.topic)})
        names["cameras"] = {role: topics.resolved(self.resolve) for role, topics in self.cameras.items()}
        return self.model_copy(update=names)


_PARTS = (
    *("command", "odometry", "color", "color_info", "depth", "depth_info", "hazards", "bumper", "battery", "dock"),
    *("undock", "discrete_move"),
)


def ros2_interface(profile: RobotProfile) -> Ros2Interface:
    """Return the ROS 2 interface of a profile, with full names.

    Raises:
        RobotError: the profile has another interface or none.
    """
    return require_interface(profile, "ros2", Ros2Interface, "turtlebot4")


def require_velocities(names: Ros2Interface) -> None:
    """Make sure that velocities move the robot.

    Raises:
        RobotError: the profile leaves its movements to a motion adapter.
    """
    if not names.command:
        raise RobotError(
            f"the profile names no topic for velocities: a motion adapter serves {names.discrete_move}",
            advice="start the adapter, or name interface.command",
            code="no-velocities",
        )


def in_namespace(profile: RobotProfile, namespace: str) -> RobotProfile:
    """Return the same profile with another namespace.

    Raises:
        RobotError: the namespace is invalid, or the profile has no ROS 2 interface.
    """
    if not isinstance(profile.interface, Ros2Interface):
        raise RobotError(
            f"robot profile {profile.name} has no ROS 2 interface",
            advice="remove the namespace: ROS 1 has none",
            code="wrong-interface",
        )
    try:
        interface = Ros2Interface.model_validate(profile.interface.model_dump() | {"namespace": namespace})
    except ValueError as error:
        raise RobotError(
            f"{namespace!r} is not a valid ROS 2 namespace",
            advice="use letters, digits, _ and /",
            code="invalid-namespace",
        ) from error
    return profile.model_copy(update={"interface": interface}).given_as(profile.given_in(namespace))
