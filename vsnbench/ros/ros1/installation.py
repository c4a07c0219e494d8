"""Check that ROS 1 is installed."""

from vsnbench.errors import RobotError
from vsnbench.runtime import ros_version
from vsnbench.runtime.ros_version import RosGeneration

REQUIRED = (
    "rospy",
    "rosgraph",
    "genpy",
    "rosgraph_msgs",
    "std_msgs",
    "std_srvs",
    "geometry_msgs",
    "nav_msgs",
    "sensor_msgs",
)
"""Python packages of ROS 1 that the nodes and the client import."""
INSTALL = "run scripts/install_ros.sh, or see docs/robot.md"


def missing_packages() -> list[str]:
    """Return the packages of REQUIRED that cannot be imported, and reserve this process for ROS 1.

    Raises:
        RobotError: the process uses ROS 2.
    """
    return ros_version.missing_packages(RosGeneration.ROS1, REQUIRED)


def require_ros1() -> None:
    """Make sure that ROS 1 can be imported.

    Raises:
        RobotError: ROS 1 is not installed.
    """
    if missing := missing_packages():
        raise RobotError(
            f"ROS 1 is not installed for this Python (no module {missing[0]})",
            advice=INSTALL,
            code="ros-not-installed",
        )
