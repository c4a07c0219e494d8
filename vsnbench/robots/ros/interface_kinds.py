"""The kinds of interface that a robot profile can have."""

from typing import Annotated

from pydantic import Field

from vsnbench.errors import RobotError
from vsnbench.robots.adapter.interface import AdapterInterface
from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.ros1.interface import Ros1Interface
from vsnbench.ros.ros2.interface import Ros2Interface
from vsnbench.values.robot_profile import RobotProfile

KnownInterface = Annotated[Ros1Interface | Ros2Interface | AdapterInterface, Field(discriminator="kind")]
"""The fields of a profile's `interface`, by its `kind`."""


def interface_of(profile: RobotProfile) -> RosInterface:
    """Return the interface of a profile with full names.

    Raises:
        RobotError: the profile has no interface of a known kind.
    """
    if isinstance(profile.interface, RosInterface):
        return profile.interface.resolved()
    raise RobotError(
        f"robot profile {profile.name} has {profile.interface.kind if profile.interface else 'no'} interface",
        advice="this needs one of `kind: ros1` or `kind: ros2` (vsnbench robots show turtlebot4)",
        code="wrong-interface",
    )
