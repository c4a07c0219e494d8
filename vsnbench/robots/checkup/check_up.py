"""The check-up of a profile's robot."""

from collections.abc import Iterator

from vsnbench.robots.adapter.interface import AdapterInterface
from vsnbench.robots.checkup.adapters.socket import AdapterCheckup
from vsnbench.robots.checkup.result import CheckResult
from vsnbench.robots.checkup.ros1 import Ros1Checkup
from vsnbench.robots.checkup.ros2 import Ros2Checkup
from vsnbench.robots.ros.interface_kinds import interface_of
from vsnbench.values.robot_identity import ROS1
from vsnbench.values.robot_profile import RobotProfile


def check_up(profile: RobotProfile, *, move: bool = False) -> Iterator[CheckResult]:
    """Check every part of a robot.

    Args:
        profile: profile of the robot.
        move: whether the robot may turn on the spot to check its odometry.

    Raises:
        RobotError: the profile has no interface of a known kind.
    """
    if isinstance(profile.interface, AdapterInterface):
        return AdapterCheckup(profile).results(move=move)
    checkup = Ros1Checkup(profile) if interface_of(profile).kind == ROS1 else Ros2Checkup(profile)
    return checkup.results(move=move)
