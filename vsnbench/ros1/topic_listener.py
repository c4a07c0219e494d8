"""Listens to topics of any type: how often something comes, how old it is, and the last messages as bytes.

Imported only where ROS is installed.
"""

import struct
from collections.abc import Sequence
from typing import Any

import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image

from vsnbench.ros1.battery import BATTERY_CLASSES
from vsnbench.ros1.node import start_node
from vsnbench.sensing.heard import Heard, Hearing
from vsnbench.sensing.odometry import heading_of_quaternion

_CONNECTING_S = 0.5
_CLASSES: dict[str, Any] = {
    "nav_msgs/Odometry": Odometry,
    "sensor_msgs/CameraInfo": CameraInfo,
    "sensor_msgs/Image": Image,
    **BATTERY_CLASSES,
}


def message_class(name: str) -> Any:
    """Return the class of a message type such as `sensor_msgs/Image`, one of the few that a check-up reads."""
    return _CLASSES[name]


class TopicListener:
    """A node that listens; one a process."""

    def __init__(self, name: str, topics: Sequence[str]) -> None:
        start_node(name)
        self._hearing = Hearing(topics)
        for topic in topics:
            rospy.Subscriber(topic, rospy.AnyMsg, self._keeper(topic), queue_size=50, buff_size=1 << 24)

    def listen(self, seconds: float) -> dict[str, Heard]:
        """Wait, and return what has come on each topic once its publishers were connected."""
        return self._hearing.listen(_CONNECTING_S, seconds)

    def heading_rad(self, topic: str) -> float | None:
        """Return the heading of the newest odometry, after waiting for it to settle; None when nothing comes."""
        data = self._hearing.settled(topic)
        if data is None:
            return None
        turn = Odometry().deserialize(data).pose.pose.orientation
        return heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)

    def close(self) -> None:
        """Leave the ROS network."""
        rospy.signal_shutdown("closed")

    def _keeper(self, topic: str) -> "rospy.AnyMsg":
        def keep(message: "rospy.AnyMsg") -> None:
            arrival_s, data = rospy.get_time(), message._buff  # noqa: SLF001
            secs, nsecs = struct.unpack_from("<II", data, 4) if len(data) >= 12 else (0, 0)
            sender = str(message._connection_header.get("callerid", "?"))  # noqa: SLF001
            self._hearing.keep(topic, data, sender, arrival_s=arrival_s, stamp_s=secs + nsecs * 1e-9)

        return keep
