"""Who a robot is, as far as results depend on it: what the thing at the other end says of itself."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

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


class SimulationAccount(BaseModel):
    """What a simulator says of itself; what results depend on becomes a part of the robot's conditions."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    simulator: str = Field(max_length=200, description="edition of the simulator and its libraries")
    site: str = Field(max_length=200, description="name of the site that it plays")
    site_sha256: str = Field(pattern=r"^[0-9a-f]{64}$", description="content hash of that site")
    profile_sha256: str = Field(pattern=r"^[0-9a-f]{64}$", description="content hash of the profile that it plays")
    odometry_rate_hz: float = Field(gt=0, le=1000)
    command_lag_s: float = Field(ge=0, le=10)
    rate_factor: float = Field(gt=0, le=100, description="simulated seconds per second")
    noise: dict[str, Any] | None = Field(default=None, description="settings of its noise; none for exact sensors")
    pretends_to_be_real: bool = Field(default=False, description="a rehearsal: a person is asked to place the robot")

    @property
    def conditions(self) -> Mapping[str, Any]:
        """What results depend on beside site and profile."""
        own = self.model_dump(
            mode="json",
            include={"simulator", "odometry_rate_hz", "command_lag_s", "rate_factor", "noise", "pretends_to_be_real"},
        )
        return {name: value for name, value in own.items() if value is not None and value is not False}
