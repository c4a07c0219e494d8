"""The interface of a robot profile whose `kind` is `ros2`: the names by which its parts are reached."""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_profile import Interface, RobotProfile

RosName = Annotated[str, Field(pattern=r"^(/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?$")]
"""A topic's name, in the robot's namespace where it does not begin with a slash; empty for what it does not have."""
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
VELOCITIES = (TWIST, TWIST_STAMPED)
"""Types in which a base may take velocities."""


class Ros2Interface(Interface):
    """Topics of a robot on a ROS 2 graph; an empty name means that the robot does not have it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["ros2"]
    namespace: RosName = Field(default="", description="of this one robot: where it is reached, not what it is")
    command: RosName = Field(default="cmd_vel", min_length=1)
    command_type: Literal["", "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"] = Field(
        default="", description="empty: whichever the base listens to"
    )
    odometry: RosName = Field(default="odom", min_length=1)
    color: RosName = Field(default="camera/color/image_raw", min_length=1)
    color_info: RosName = "camera/color/camera_info"
    depth: RosName = "camera/depth/image_raw"
    depth_info: RosName = "camera/depth/camera_info"
    image_turns: int = Field(default=0, ge=0, le=3, description="quarter turns clockwise that set an image upright")
    hazards: RosName = Field(default="", description="irobot_create_msgs/msg/HazardDetectionVector")
    bumper: RosName = Field(default="", description="std_msgs/msg/Bool, true while pressed")
    battery: RosName = Field(default="", description="sensor_msgs/msg/BatteryState")
    dock: RosName = Field(default="", description="irobot_create_msgs/msg/DockStatus")
    undock: RosName = Field(default="", description="action irobot_create_msgs/action/Undock")
    discrete_move: RosName = Field(
        default="discrete_move", description="of the node beside the base; without one this process steers"
    )
    camera_rate_hz: float = Field(default=30.0, gt=0, le=240)
    depth_frames: int = Field(default=10, ge=1, le=100, description="depth images of one median (paper, vsn.yaml)")
    command_timeout_s: float = Field(
        default=0.5, gt=0, le=60, description="the base stands still when it hears no command for this long"
    )

    def resolve(self, name: str) -> str:
        """Return a topic's full name in this robot's namespace; empty stays empty."""
        if not name or name.startswith("/"):
            return name
        return f"{self.root}/{name}"

    @property
    def root(self) -> str:
        """The namespace with its slash; empty for none."""
        return f"/{self.namespace.strip('/')}" if self.namespace.strip("/") else ""

    def resolved(self) -> Self:
        """Return the interface with every name in full."""
        return self.model_copy(update={part: self.resolve(getattr(self, part)) for part in _PARTS})


_PARTS = (
    *("command", "odometry", "color", "color_info", "depth", "depth_info", "hazards", "bumper", "battery", "dock"),
    *("undock", "discrete_move"),
)


def ros2_interface(profile: RobotProfile) -> Ros2Interface:
    """Return how a robot is reached over ROS 2, with every name in full.

    Raises:
        RobotError: its profile says that it is not.
    """
    if isinstance(profile.interface, Ros2Interface):
        return profile.interface.resolved()
    raise RobotError(
        f"robot profile {profile.name} has {profile.interface.kind if profile.interface else 'no'} interface",
        advice="over ROS 2 it needs one of `kind: ros2` (vsnbench robots show turtlebot4)",
    )


def in_namespace(profile: RobotProfile, namespace: str) -> RobotProfile:
    """Return the same kind of robot, reached in another namespace.

    Raises:
        RobotError: the namespace is none, or the profile is not one of ROS 2.
    """
    if not isinstance(profile.interface, Ros2Interface):
        raise RobotError(f"robot profile {profile.name} is not one of ROS 2", advice="only those have a namespace")
    try:
        interface = Ros2Interface.model_validate(profile.interface.model_dump() | {"namespace": namespace})
    except ValueError as error:
        raise RobotError(f"{namespace!r} is no namespace of ROS 2", advice="letters, digits, _ and /") from error
    return profile.model_copy(update={"interface": interface})
