"""The kinds of interface that a robot profile can have: all in which they differ outside of their rooms, in a table."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_identity import ROS1, ROS2
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros1.interface import Ros1Interface, ros1_interface
from vsnbench.ros2.interface import Ros2Interface, ros2_interface

if TYPE_CHECKING:
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.robots.check_result import CheckResult
    from vsnbench.robots.ros_link import RobotLink

KnownInterface = Annotated[Ros1Interface | Ros2Interface, Field(discriminator="kind")]
"""The fields of a profile's `interface`, by its `kind`."""


@dataclass(frozen=True, slots=True)
class InterfaceKind:
    """One way in which a robot is spoken to."""

    words: str
    """For people."""
    names_of: Callable[[RobotProfile], Any]
    """Returns a profile's interface with names as the network has them; see `ros_link.RobotTopics`."""
    connect: "Callable[[RobotProfile, ProtocolParameters], RobotLink]"
    """Joins the network; raises a RobotError where its ROS is not installed, or the network refuses us."""
    check_up: "Callable[[RobotProfile, bool], Iterator[CheckResult]]"
    """Looks at every part of a robot; the second argument says whether it may turn a little on the spot."""
    bumpers: tuple[str, ...]
    """The fields that name a topic on which contacts come."""
    topics: tuple[str, ...]
    """The fields that name a topic of its own."""


def _connect_ros1(profile: RobotProfile, _parameters: "ProtocolParameters") -> "RobotLink":
    from vsnbench.ros1.installation import require_ros1

    require_ros1()
    from vsnbench.ros1.robot_link import RobotLink as Ros1Link

    return Ros1Link(profile)


def _connect_ros2(profile: RobotProfile, parameters: "ProtocolParameters") -> "RobotLink":
    from vsnbench.ros2.installation import require_ros2

    require_ros2()
    from vsnbench.ros2.robot_link import RobotLink as Ros2Link

    return Ros2Link(profile, parameters)


def _check_up_ros1(profile: RobotProfile, move: bool) -> "Iterator[CheckResult]":
    from vsnbench.robots.ros1_checkup import check_ros_robot

    return check_ros_robot(profile, move=move)


def _check_up_ros2(profile: RobotProfile, move: bool) -> "Iterator[CheckResult]":
    from vsnbench.robots.ros2_checkup import check_ros2_robot

    return check_ros2_robot(profile, move=move)


_SHARED_TOPICS = ("command", "odometry", "color", "depth", "bumper")
INTERFACE_KINDS: Mapping[str, InterfaceKind] = {
    ROS1: InterfaceKind(
        "over ROS 1",
        ros1_interface,
        _connect_ros1,
        _check_up_ros1,
        bumpers=("bumper",),
        topics=(*_SHARED_TOPICS, "cliff", "wheel_drop", "battery"),
    ),
    ROS2: InterfaceKind(
        "over ROS 2",
        ros2_interface,
        _connect_ros2,
        _check_up_ros2,
        bumpers=("bumper", "hazards"),
        topics=(*_SHARED_TOPICS, "hazards", "battery", "dock"),
    ),
}
"""By `interface.kind`."""


def kind_of(profile: RobotProfile) -> InterfaceKind:
    """Return how a profile's robot is spoken to.

    Raises:
        RobotError: it has no interface.
    """
    found = INTERFACE_KINDS.get(profile.interface.kind) if profile.interface else None
    if found is None:
        raise RobotError(
            f"robot profile {profile.name} has {profile.interface.kind if profile.interface else 'no'} interface",
            advice="a real robot needs one of `kind: ros1` or `kind: ros2` (vsnbench robots show turtlebot4)",
        )
    return found


def connect(profile: RobotProfile, parameters: "ProtocolParameters") -> "RobotLink":
    """Join the network that a robot's profile speaks of.

    Raises:
        RobotError: the profile has no such interface, its ROS is not installed, or the network refuses us.
    """
    return kind_of(profile).connect(profile, parameters)


def interface_of(profile: RobotProfile) -> Any:
    """Return a profile's interface with names as the network has them; see `ros_link.RobotTopics`.

    Raises:
        RobotError: it has none.
    """
    return kind_of(profile).names_of(profile)
