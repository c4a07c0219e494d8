"""Whether ROS 1 can be imported here, and the one line that says how to install it."""

from vsnbench import ros_generation
from vsnbench.errors import RobotError
from vsnbench.ros_generation import RosGeneration

NEEDED = (
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
"""The Python packages of ROS 1 that our nodes and the client import."""


def missing_packages() -> list[str]:
    """Return the names in NEEDED that cannot be imported; from then on this process speaks ROS 1.

    Raises:
        RobotError: it speaks ROS 2 already.
    """
    return ros_generation.missing_packages(RosGeneration.ROS1, NEEDED)


def require_ros1() -> None:
    """Make sure that ROS 1 can be imported.

    Raises:
        RobotError: it cannot; the message says how to install it.
    """
    missing = missing_packages()
    if missing:
        raise RobotError(
            f"ROS 1 is not installed for this Python (no module {missing[0]})",
            advice="run scripts/install_ros.sh, or see docs/robot.md",
        )
