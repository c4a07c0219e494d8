"""What results on a ROS network depend on: what a simulator plays, and whose discrete_move serves."""

from collections.abc import Mapping
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_identity import SimulationAccount
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.ros_link import RobotLink
from vsnbench.robots.ros_start import Patience
from vsnbench.sensing.simulation import ACCOUNT


def await_account(link: RobotLink, profile: RobotProfile, patience: Patience) -> SimulationAccount:
    """Return what the simulator says of itself.

    Raises:
        RobotError: it says nothing, or plays another robot.
    """
    account = link.wait_for(lambda now: now.simulation, patience.left_s)
    if account is None:
        raise RobotError(
            f"the simulator says nothing of itself on {ACCOUNT} (waited {patience.allowed_s:.0f} s)",
            advice="run the same version of vsnbench on both sides",
        )
    if account.profile_sha256 != profile.sha256:
        raise RobotError(
            f"the simulator plays another robot than {profile.name}, by the content of its profile",
            advice=f"start it with the profile of the run (vsnbench {link.kind} simulate --robot ...)",
        )
    return account


def conditions_of(link: RobotLink, account: SimulationAccount | None, depth_frames: int) -> dict[str, Any]:
    """Return what results depend on: the depth filter, whose discrete_move it is, what a simulator says of itself."""
    return {
        "depth_frames": depth_frames,
        "discrete_move": link.server,
        **(account.conditions if account else {}),
    }


def require_same_conditions(link: RobotLink, account: SimulationAccount | None, conditions: Mapping[str, Any]) -> None:
    """Make sure that the network is still what the session began with: another would be another campaign.

    Raises:
        RobotError: the simulator was started anew as something else, or discrete_move is another one.
    """
    now = link.snapshot().simulation
    if now != account:
        played = f"site {now.site}" if now else "unknown"
        raise RobotError(
            f"the simulator was started anew and plays something else ({played}) than this session began with",
            advice="start the session anew, or the simulator as it was",
        )
    served = conditions_of(link, account, conditions["depth_frames"])["discrete_move"]
    if served != conditions["discrete_move"]:
        raise RobotError(
            f"{link.names.discrete_move} was served by {_WHOSE[conditions['discrete_move']]} when this session began, "
            f"and now it is {_WHOSE[served]}",
            advice="start the session anew (another campaign), or the server as it was",
        )


_WHOSE = {"vsnbench": "vsnbench's own server", "another": "another server", "workstation": "this process"}
