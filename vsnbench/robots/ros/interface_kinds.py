"""The kinds of interface that a robot profile can have."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from vsnbench.errors import RobotError
from vsnbench.ros1.interface import Ros1Interface, ros1_interface
from vsnbench.ros2.interface import Ros2Interface, ros2_interface
from vsnbench.ros_common.interface import RosInterface
from vsnbench.values.robot_identity import ROS1, ROS2
from vsnbench.values.robot_profile import RobotProfile

KnownInterface = Annotated[Ros1Interface | Ros2Interface, Field(discriminator="kind")]
"""The fields of a profile's `interface`, by its `kind`."""
_SHARED_TOPICS = ("command", "odometry", "color", "depth", "bumper")


@dataclass(frozen=True, slots=True)
class InterfaceKind:
    """One kind of interface."""

    kind: str
    """Value of `interface.kind`."""
    title: str
    """Description for lists of robots."""
    names_of: Callable[[RobotProfile], RosInterface]
    """Returns the interface of a profile with full names."""
    bumpers: tuple[str, ...]
    """Fields that name a topic with contacts."""
    topics: tuple[str, ...]
    """Fields whose topics must differ."""


INTERFACE_KINDS: Mapping[str, InterfaceKind] = {
    kind.kind: kind
    for kind in (
        InterfaceKind(
            ROS1,
            "over ROS 1",
            ros1_interface,
            bumpers=("bumper",),
            topics=(*_SHARED_TOPICS, "cliff", "wheel_drop", "battery"),
        ),
        InterfaceKind(
            ROS2,
            "over ROS 2",
            ros2_interface,
            bumpers=("bumper", "hazards"),
            topics=(*_SHARED_TOPICS, "hazards", "battery", "dock"),
        ),
    )
}
"""By `interface.kind`."""


def kind_of(profile: RobotProfile) -> InterfaceKind:
    """Return the kind of a profile's interface.

    Raises:
        RobotError: the profile has no interface of a known kind.
    """
    found = INTERFACE_KINDS.get(profile.interface.kind) if profile.interface else None
    if found is None:
        raise RobotError(
            f"robot profile {profile.name} has {profile.interface.kind if profile.interface else 'no'} interface",
            advice="a real robot needs one of `kind: ros1` or `kind: ros2` (vsnbench robots show turtlebot4)",
            code="wrong-interface",
        )
    return found


def interface_of(profile: RobotProfile) -> RosInterface:
    """Return the interface of a profile with full names.

    Raises:
        RobotError: the profile has no interface of a known kind.
    """
    return kind_of(profile).names_of(profile)
