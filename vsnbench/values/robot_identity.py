"""Identity of a robot, as far as results depend on it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from vsnbench.values.robot_profile import RobotProfile

SIMULATED = "simulated"
"""Kind of the simulated robot inside this process."""
ROS1 = "ros1"
"""Kind of a real or simulated robot over ROS 1."""
ROS2 = "ros2"
"""Kind of a real or simulated robot over ROS 2."""
ADAPTER = "adapter"
"""Kind of a real or simulated robot behind a motion adapter."""
IMPORTED = "imported"
"""Origin of imported episodes, and kind of their robots."""
REHEARSAL_KEY = "pretends_to_be_real"
"""Condition of a rehearsal, as records and simulators have it."""


def kind_of_class(robot_class: type) -> str:
    """Return the kind of a user's robot class: `package.module:Class`, independent of how it was named."""
    return f"{robot_class.__module__}:{robot_class.__qualname__}"


@dataclass(frozen=True, slots=True)
class RobotIdentity:
    """Identity of a robot by its content; only results of robots with equal `sha256` are pooled.

    Nothing is parsed from what the user typed: a profile counts by its content, and the robot itself reports whether it
    is simulated.
    """

    profile: RobotProfile
    kind: str
    """`simulated`, `ros1`, `ros2`, `adapter`, or `package.module:Class` of a user's robot."""
    simulated: bool
    site_sha256: str = ""
    """Hash of the site that a simulated robot simulates; empty for a real robot."""
    code_sha256: str = ""
    """Hash of a user's code; empty for built-in robots."""

    @property
    def sha256(self) -> str:
        """Hash of profile, kind, code, and whether it is simulated; the site is part of the campaign's own key."""
        content = [self.profile.sha256, self.kind, self.simulated, self.code_sha256]
        return hashlib.sha256(json.dumps(content, separators=(",", ":")).encode()).hexdigest()


class SimulationAccount(BaseModel):
    """Self-description of a simulator; settings that affect results become part of the robot's conditions."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)

    simulator: str = Field(max_length=200, description="edition of the simulator and its libraries")
    site: str = Field(max_length=200, description="name of the site that it plays")
    site_sha256: str = Field(pattern=r"^[0-9a-f]{64}$", description="content hash of that site")
    profile_sha256: str = Field(pattern=r"^[0-9a-f]{64}$", description="content hash of the profile that it plays")
    odometry_rate_hz: float = Field(gt=0, le=1000)
    base: dict[str, Any] = Field(default_factory=dict, description="how its base differs from an ideal one")
    rate_factor: float = Field(gt=0, le=100, description="simulated seconds per second")
    noise: dict[str, Any] | None = Field(default=None, description="settings of its noise; none for exact sensors")
    is_rehearsal: bool = Field(default=False, alias=REHEARSAL_KEY, description="whether an operator places the robot")

    @property
    def conditions(self) -> Mapping[str, Any]:
        """Settings that affect results, in addition to site and profile."""
        own = self.model_dump(
            mode="json",
            by_alias=True,
            include={"simulator", "odometry_rate_hz", "base", "rate_factor", "noise", "is_rehearsal"},
        )
        return {name: value for name, value in own.items() if value is not None and value is not False and value != {}}
