"""What only a simulated robot has: topics and services in place of a person and a tape, and its account of itself."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vsnbench.errors import RobotError

PLACE = "/simulation/place_robot"
"""Put the robot down at a starting position."""
GROUND_TRUTH = "/simulation/ground_truth"
"""Odometry: where the robot truly stands, in the site's frame."""
CONTACT = "/simulation/contact"
"""A latched string: what the robot touches; empty for nothing."""
INSTANCES = "/simulation/instances/image_raw"
"""An image 16UC1, stamped as its colour image: the 1-based index of the site's object; 0 for the building."""
CATEGORIES = "/simulation/instances/categories"
"""A latched string: a JSON object, index -> category."""
ACCOUNT = "/simulation/account"
"""A latched string: a SimulationAccount as JSON."""


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


def read_account(text: str) -> SimulationAccount:
    """Read what came on ACCOUNT.

    Raises:
        RobotError: it is no account that this version understands.
    """
    try:
        return SimulationAccount.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "it"
        raise RobotError(
            f"what the simulator says of itself on {ACCOUNT} cannot be read: {field}: {first['msg']}",
            advice="run the same version of vsnbench on both machines",
        ) from error
