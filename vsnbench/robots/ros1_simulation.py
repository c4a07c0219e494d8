"""What a simulator at the other end of a ROS 1 network plays, and whether it is what the run is about."""

from typing import TYPE_CHECKING

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros1.simulation import ACCOUNT, SimulationAccount

if TYPE_CHECKING:
    from vsnbench.robots.ros1_start import Patience
    from vsnbench.ros1.robot_link import RobotLink


def await_account(link: "RobotLink", profile: RobotProfile, patience: "Patience") -> SimulationAccount:
    """Return what the simulator says of itself.

    Raises:
        RobotError: it says nothing, or plays another robot.
    """
    account = link.wait_for(lambda now: now.simulation, patience.left_s)
    if account is None:
        raise RobotError(
            f"the simulator says nothing of itself on {ACCOUNT} (waited {patience.allowed_s:.0f} s): "
            "run the same version of vsnbench on both sides"
        )
    if account.profile_sha256 != profile.sha256:
        raise RobotError(
            f"the simulator plays another robot than {profile.name}, by the content of its profile: start it with the "
            "profile of the run (vsnbench ros simulate --robot ...)"
        )
    return account


def require_same_account(link: "RobotLink", opened_with: SimulationAccount) -> None:
    """Make sure that the simulator is still the one that the session began with, or plays the same.

    Raises:
        RobotError: it was started anew as something else.
    """
    now = link.wait_for(lambda now: now.simulation, 0.0)
    if now != opened_with:
        played = now.site if now else "unknown"
        raise RobotError(
            f"the simulator was started anew and plays something else (site {played}) than this session began with "
            f"(site {opened_with.site}): start the session anew, or the simulator as it was"
        )
