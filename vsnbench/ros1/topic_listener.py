"""Listens to topics of any type: how often something comes, how old it is, and the last messages as bytes.

Imported only where ROS is installed.
"""

import struct
import threading
import time
from collections.abc import Sequence
from typing import Any

import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image

from vsnbench.ros1.node import start_node
from vsnbench.sensing.heard import Heard
from vsnbench.sensing.odometry import heading_of_quaternion

_KEEP = 12
_CLASSES: dict[str, Any] = {
    "nav_msgs/Odometry": Odometry,
    "sensor_msgs/CameraInfo": CameraInfo,
    "sensor_msgs/Image": Image,
}


def message_class(name: str) -> Any:
    """Return the class of a message type such as `sensor_msgs/Image`, one of the few that a check-up reads."""
    return _CLASSES[name]


class TopicListener:
    """A node that listens; one a process."""

    def __init__(self, name: str, topics: Sequence[str]) -> None:
        start_node(name)
        self._lock = threading.Lock()
        self._heard = {topic: Heard() for topic in topics}
        for topic in topics:
            rospy.Subscriber(topic, rospy.AnyMsg, self._keeper(topic), queue_size=50, buff_size=1 << 24)

    def listen(self, seconds: float) -> dict[str, Heard]:
        """Wait, and return what has come on each topic since the listener was made."""
        # The first half second is for connecting; rates are those of the rest.
        time.sleep(0.5)
        with self._lock:
            for topic in self._heard:
                self._heard[topic] = Heard()
        time.sleep(seconds)
        with self._lock:
            return dict(self._heard)

    def heading_rad(self, topic: str) -> float | None:
        """Return the heading of the newest odometry, after waiting for it to settle; None when nothing comes."""
        time.sleep(0.3)
        with self._lock:
            data = self._heard[topic].messages[-1:] if topic in self._heard else []
        if not data:
            return None
        turn = Odometry().deserialize(data[0]).pose.pose.orientation
        return heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)

    def close(self) -> None:
        """Leave the ROS network."""
        rospy.signal_shutdown("closed")

    def _keeper(self, topic: str) -> "rospy.AnyMsg":
        def keep(message: "rospy.AnyMsg") -> None:
            data = message._buff  # noqa: SLF001
            arrival_s = rospy.get_time()
            secs, nsecs = struct.unpack_from("<II", data, 4) if len(data) >= 12 else (0, 0)
            with self._lock:
                heard = self._heard[topic]
                heard.arrivals.append(arrival_s)
                heard.stamps.append(secs + nsecs * 1e-9)
                heard.messages.append(data)
                heard.senders.add(str(message._connection_header.get("callerid", "?")))  # noqa: SLF001
                del heard.messages[:-_KEEP]

        return keep
