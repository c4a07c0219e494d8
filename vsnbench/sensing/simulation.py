"""What only a simulated robot has: topics and services in place of a person and a tape, and how its account is read."""

from pydantic import ValidationError

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_identity import SimulationAccount

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
