"""Whether ROS 2 can be imported here, and the one line that says how to install it.

Where a distribution's rclpy comes first on the path (a sourced /opt/ros/...), that one is used; else pip's wheels.
"""

import importlib
import os
from typing import Any

from vsnbench import ros_generation
from vsnbench.errors import RobotError
from vsnbench.ros_generation import RosGeneration

NEEDED = ("rclpy", "rosgraph_msgs", "std_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs")
"""The Python packages of ROS 2 that our nodes and the client import."""
INSTALL = "pip install 'vsnbench[ros2]', or source a distribution's setup.bash"


def missing_packages() -> list[str]:
    """Return the names in NEEDED that cannot be imported; from then on this process speaks ROS 2.

    Raises:
        RobotError: it speaks ROS 1 already.
    """
    return ros_generation.missing_packages(RosGeneration.ROS2, NEEDED)


def require_ros2() -> None:
    """Make sure that ROS 2 can be imported.

    Raises:
        RobotError: it cannot; the message says how to install it.
    """
    missing = missing_packages()
    if missing:
        raise RobotError(f"ROS 2 is not installed for this Python (no module {missing[0]})", advice=INSTALL)
    if os.environ.get("ROS_DISTRO", "") in ("noetic", "melodic"):
        raise RobotError(
            f"this shell is set up for ROS 1 ({os.environ['ROS_DISTRO']})",
            advice="open one that has not sourced its setup.bash",
        )
    try:
        importlib.import_module("rclpy.node")
    except ImportError as error:
        first = str(error).partition("\n")[0]
        raise RobotError(
            f"rclpy is found and cannot be loaded ({first})",
            advice=f"it is another Python's, or half installed: {INSTALL}",
        ) from error


def discovery() -> str:
    """Return in words how far this process looks for robots: domain and range."""
    domain = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") or "SUBNET"
    server = os.environ.get("ROS_DISCOVERY_SERVER", "")
    return f"domain {domain}, {f'discovery server {server}' if server else f'discovery range {reach}'}"


def irobot_type(kind: str, name: str) -> Any:
    """Return a type of irobot_create_msgs, a `msg` or an `action`; None where the package is not on this machine.

    It comes with a distribution (`ros-<distro>-irobot-create-msgs`, sourced) and in no wheel.
    """
    try:
        return getattr(importlib.import_module(f"irobot_create_msgs.{kind}"), name)
    except (ImportError, AttributeError):
        return None
