"""Check that ROS 2 is installed.

The rclpy of a sourced distribution (/opt/ros/...) takes precedence over pip's wheels.
"""

import importlib
import os
import subprocess
import sys
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.installation import command_to_add
from vsnbench.runtime import ros_version
from vsnbench.runtime.ros_version import RosGeneration

REQUIRED = ("rclpy", "rosgraph_msgs", "std_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs")
"""Python packages of ROS 2 that the nodes and the client import."""
INSTALL = f"{command_to_add('ros2')}, or source the setup.bash of a distribution"


def missing_packages() -> list[str]:
    """Return the packages of REQUIRED that cannot be imported, and reserve this process for ROS 2.

    Raises:
        RobotError: the process uses ROS 1.
    """
    return ros_version.missing_packages(RosGeneration.ROS2, REQUIRED)


def require_ros2() -> None:
    """Make sure that ROS 2 can be imported.

    Raises:
        RobotError: ROS 2 is not installed, or not with the middleware that RMW_IMPLEMENTATION names.
    """
    if missing := missing_packages():
        raise RobotError(
            f"ROS 2 is not installed for this Python (no module {missing[0]})", advice=INSTALL, code="ros-not-installed"
        )
    if os.environ.get("ROS_DISTRO", "") in ("noetic", "melodic"):
        raise RobotError(
            f"this shell is set up for ROS 1 ({os.environ['ROS_DISTRO']})",
            advice="open a shell without that setup.bash",
            code="wrong-ros",
        )
    if (wanted := os.environ.get("RMW_IMPLEMENTATION", "")) and "rclpy.node" not in sys.modules:
        _require_middleware(wanted)
    try:
        importlib.import_module("rclpy.node")
    except ImportError as error:
        first = str(error).partition("\n")[0]
        raise RobotError(
            f"rclpy is installed but cannot be loaded ({first})",
            advice=f"it may belong to another Python: {INSTALL}",
            code="ros-not-installed",
        ) from error


def _require_middleware(wanted: str) -> None:
    """Make sure that rclpy can be imported with a middleware: without it, rcl ends the process that imports it."""
    if subprocess.run([sys.executable, "-c", "import rclpy.node"], capture_output=True, check=False).returncode != 0:
        package = f"ros-$ROS_DISTRO-{wanted.replace('_', '-')}"
        raise RobotError(
            f"the ROS 2 of this Python cannot use the middleware {wanted} (RMW_IMPLEMENTATION)",
            advice=f"unset it (pip's wheels have Fast DDS alone), or source a distribution with {package}",
            code="no-middleware",
        )


def discovery() -> str:
    """Return the discovery settings of this process: domain, and range or server."""
    domain = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") or "SUBNET"
    server = os.environ.get("ROS_DISCOVERY_SERVER", "")
    return f"domain {domain}, {f'discovery server {server}' if server else f'discovery range {reach}'}"


def irobot_type(kind: str, name: str) -> Any:
    """Return a type of irobot_create_msgs, or None if the package is not installed.

    No wheel has it; it is part of a distribution (`ros-<distro>-irobot-create-msgs`).

    Args:
        kind: `msg` or `action`.
        name: name of the type.
    """
    try:
        return getattr(importlib.import_module(f"irobot_create_msgs.{kind}"), name)
    except (ImportError, AttributeError):
        return None


def type_of(message_class: type) -> str:
    """Return the type of a message class, such as `nav_msgs/msg/Odometry`."""
    return f"{message_class.__module__.partition('.')[0]}/msg/{message_class.__name__}"


def require_tf_message() -> Any:
    """Return the class of tf2_msgs/msg/TFMessage, which is part of a distribution and not of a wheel.

    Raises:
        RobotError: the package is not installed.
    """
    try:
        return importlib.import_module("tf2_msgs.msg").TFMessage
    except (ImportError, AttributeError) as error:
        raise RobotError(
            "odometry from TF needs the Python module tf2_msgs, which is not installed",
            advice="source the setup.bash of a ROS 2 distribution (ros-<distro>-tf2-msgs); no wheel has it",
            code="no-tf2-msgs",
        ) from error
