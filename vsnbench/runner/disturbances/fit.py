"""Checks that disturbances fit the robot and the model."""

import logging
from collections.abc import Collection

from vsnbench.errors import UsageError
from vsnbench.protocol.disturbances import Disturbances
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import is_profile
from vsnbench.runner.disturbances.policy_view import displaced
from vsnbench.values.observation import Sensor

logger = logging.getLogger(__name__)


def check_before_opening(disturbances: Disturbances, robot: str, *, rehearsal: bool) -> None:
    """Refuse what is known to fail before a robot is opened, which can take long and needs the robot.

    Raises:
        UsageError: a disturbance moves the camera of a real robot, or of a rehearsal (`geometry-disturbance`).
    """
    if rehearsal:
        _refuse_geometry(disturbances, "a rehearsal, because the real session refuses it")
    if is_profile(robot):
        _refuse_geometry(disturbances, f"robot {robot}")


def check_disturbances(disturbances: Disturbances, robot: Robot) -> None:
    """Check that a robot can render the disturbances.

    Raises:
        UsageError: it cannot (`geometry-disturbance`), or the camera would be where no camera can be
            (`invalid-disturbance`).
    """
    if not robot.renders_views:
        _refuse_geometry(disturbances, f"robot {robot.identity.profile.name}")
    camera = robot.identity.profile.camera
    try:
        displaced(camera, disturbances)
    except ValueError:
        moved = ", ".join(member.text for member in disturbances.members if member.kind.geometric)
        raise UsageError(
            f"--disturb {moved}: the camera of {robot.identity.profile.name} is {camera.mount_height_m:g} m above the "
            f"floor with a tilt of {camera.tilt_deg:g} deg",
            advice="keep it above the floor and below 3 m, and its tilt between -90 and 60 deg",
            code="invalid-disturbance",
        ) from None


def warn_of_unused(disturbances: Disturbances, model: str, sensors: Collection[Sensor]) -> None:
    """Log a warning for each disturbance that changes only sensors that the model does not use."""
    for name in disturbances.unused_by(frozenset(sensors)):
        logger.warning("--disturb %s has no effect: model %s does not use that sensor", name, model)


def _refuse_geometry(disturbances: Disturbances, where: str) -> None:
    if names := disturbances.geometric:
        raise UsageError(
            f"--disturb {names[0]} does not apply to {where}",
            advice="only a run with --robot simulated renders a moved camera",
            code="geometry-disturbance",
        )
