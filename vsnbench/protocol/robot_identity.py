"""Who a robot is, as far as results depend on it: what the thing at the other end says of itself."""

import hashlib
import json
from dataclasses import dataclass

from vsnbench.protocol.robot_profile import RobotProfile

SIMULATED = "simulated"
"""The kind of our own simulated robot, within this process."""
ROS1 = "ros1"
"""The kind of a robot at the other end of a ROS 1 network, real or played."""
ROS2 = "ros2"
"""The kind of a robot at the other end of a ROS 2 graph, real or played."""
BUILT_IN_KINDS = frozenset({SIMULATED, ROS1, ROS2})


def kind_of_class(robot_class: type) -> str:
    """Return the kind of a third party's robot: `package.module:Class`, wherever and however it was named."""
    return f"{robot_class.__module__}:{robot_class.__qualname__}"


@dataclass(frozen=True, slots=True)
class RobotIdentity:
    """A robot by its content; two robots with equal `sha256` are pooled, all others are kept apart.

    Nothing of it is parsed from what was typed: a profile counts by its content, and whether a robot is simulated is
    what the robot found out, not what its name suggests.
    """

    profile: RobotProfile
    kind: str
    """`simulated`, `ros1`, `ros2`, or `package.module:Class` of a third party's robot."""
    simulated: bool
    site_sha256: str = ""
    """The content hash of the site that a simulated robot plays; empty for a real one, which is where it is."""
    code_sha256: str = ""
    """The hash of a third party's code; empty for our own robots."""

    @property
    def sha256(self) -> str:
        """Hash of profile, kind, code, and whether it is simulated; the site is a part of the campaign's own key."""
        said = [self.profile.sha256, self.kind, self.simulated, self.code_sha256]
        return hashlib.sha256(json.dumps(said, separators=(",", ":")).encode()).hexdigest()
