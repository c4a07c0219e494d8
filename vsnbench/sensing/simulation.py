"""Topics and services that only a simulated robot has."""

from pydantic import ValidationError

from vsnbench.errors import RobotError
from vsnbench.settings.validation import first_error
from vsnbench.values.robot_identity import SimulationAccount

PLACE = "/simulation/place_robot"
"""Service that puts the robot at a pose."""
GROUND_TRUTH = "/simulation/ground_truth"
"""nav_msgs/Odometry: pose of the robot in the site's frame."""
CONTACT = "/simulation/contact"
"""Latched string: the object that the robot touches, or empty."""
INSTANCES = "/simulation/instances/image_raw"
"""Image 16UC1 with the stamp of its colour image: 1-based index of the site's object; 0 for the building."""
CATEGORIES = "/simulation/instances/categories"
"""Latched string: JSON object, index to category."""
ACCOUNT = "/simulation/account"
"""Latched string: SimulationAccount as JSON."""


def read_account(text: str) -> SimulationAccount:
    """Parse a message of ACCOUNT.

    Raises:
        RobotError: the text is not an account of this version.
    """
    try:
        return SimulationAccount.model_validate_json(text)
    except ValidationError as error:
        field, problem = first_error(error, SimulationAccount)
        raise RobotError(
            f"the simulator's message on {ACCOUNT} is invalid: {field or 'the message'}: {problem.statement}",
            advice="run the same version of vsnbench on both machines",
            code="invalid-simulation-account",
        ) from error
