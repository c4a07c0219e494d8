"""Conditions of a ROS network on which results depend: the simulator, and the server of discrete_move."""

from collections.abc import Mapping
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.robots.ros.start import Patience
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.simulation import ACCOUNT
from vsnbench.values.robot_identity import SimulationAccount
from vsnbench.values.robot_profile import RobotProfile

_SERVERS = {
    "vsnbench": "the server of vsnbench",
    "another": "another server",
    "adapter": "a motion adapter",
    "workstation": "this process",
}


def await_account(link: RobotLink, profile: RobotProfile, patience: Patience) -> SimulationAccount:
    """Return the simulator's description of itself.

    Raises:
        RobotError: the simulator does not describe itself, or simulates another robot.
    """
    account = link.wait_for(lambda now: now.simulation, patience.left_s)
    if account is None:
        raise RobotError(
            f"the simulator has published nothing on {ACCOUNT} (waited {patience.allowed_s:.0f} s)",
            advice="run the same version of vsnbench on both machines",
            code="no-simulation-account",
        )
    if account.profile_sha256 != profile.sha256:
        raise RobotError(
            f"the simulator simulates another robot than {profile.name}, by the content of its profile",
            advice=f"start it with the profile of the run: vsnbench robots simulate {profile.argument}",
            code="other-simulated-robot",
        )
    return account


def conditions_of(
    link: RobotLink, profile: RobotProfile, account: SimulationAccount | None, depth_frames: int
) -> dict[str, Any]:
    """Return the conditions by name: depth filter, server of discrete_move, adapter, tolerances, simulator."""
    return {
        "depth_frames": depth_frames,
        "discrete_move": link.server,
        **({"adapter": link.adapter.condition} if link.adapter else {}),
        **profile.tolerance_conditions,
        **(account.conditions if account else {}),
    }


def require_same_conditions(link: RobotLink, account: SimulationAccount | None, conditions: Mapping[str, Any]) -> None:
    """Make sure that simulator and server are those of the start of the session.

    Raises:
        RobotError: the simulator was restarted with other settings, or discrete_move has another server.
    """
    now = link.snapshot().simulation
    if now != account:
        simulated = f"site {now.site}" if now else "unknown"
        raise RobotError(
            f"the simulator was restarted with other settings ({simulated}) than at the start of this session",
            advice="restart the session, or the simulator with its former settings",
            code="simulator-changed",
        )
    served = link.server
    if served != conditions["discrete_move"]:
        raise RobotError(
            f"{link.names.discrete_move} is now offered by {_SERVERS[served]}, and was offered by "
            f"{_SERVERS[conditions['discrete_move']]} when this session began",
            advice="restart the session, which begins another campaign, or start the former server",
            code="server-changed",
        )
    if link.adapter and link.adapter.condition != conditions.get("adapter"):
        raise RobotError(
            f"{link.names.discrete_move} is now offered by the adapter {link.adapter}, another one than when this "
            "session began",
            advice="restart the session, which begins another campaign, or start the former adapter",
            code="server-changed",
        )
