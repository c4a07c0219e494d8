"""The few message classes that are looked up by their type's name. Imported only where ROS is installed."""

from typing import Any

from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image

_CLASSES: dict[str, Any] = {
    "nav_msgs/Odometry": Odometry,
    "sensor_msgs/CameraInfo": CameraInfo,
    "sensor_msgs/Image": Image,
}


def message_class(name: str) -> Any:
    """Return the class of a message type such as `sensor_msgs/Image`."""
    return _CLASSES[name]
