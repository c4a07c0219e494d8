"""Opens the connection to the robot of a profile."""

from vsnbench.robots.ros.interface_kinds import interface_of
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.values.robot_identity import ROS1
from vsnbench.values.robot_profile import RobotProfile


def connect(profile: RobotProfile) -> RobotLink:
    """Join the network of a profile's robot.

    Raises:
        RobotError: the profile has no ROS interface, its ROS is not installed, or the network refuses the node.
    """
    if interface_of(profile).kind == ROS1:
        from vsnbench.ros.ros1.installation import require_ros1

        require_ros1()
        from vsnbench.ros.ros1.robot_link import Ros1Link

        return Ros1Link(profile)
    from vsnbench.ros.ros2.installation import require_ros2

    require_ros2()
    from vsnbench.ros.ros2.robot_link import Ros2Link

    return Ros2Link(profile)
