"""Listens to the topics of a robot: how often something comes, how old it is, and the last messages as bytes.

Imported only where ROS 2 is installed.
"""

import threading
import time
from collections.abc import Mapping
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import BatteryState, CameraInfo, Image

from vsnbench.ros2.graph import Graph
from vsnbench.ros2.messages import planar, stamp_of_serialized
from vsnbench.ros2.node import SENSOR_DATA, Ros2Node
from vsnbench.sensing.heard import Heard

CLASSES: Mapping[str, Any] = {
    "nav_msgs/msg/Odometry": Odometry,
    "sensor_msgs/msg/Image": Image,
    "sensor_msgs/msg/CameraInfo": CameraInfo,
    "sensor_msgs/msg/BatteryState": BatteryState,
}
_KEEP = 12
_CONNECTING_S = 1.5
"""With the time of listening, what the graph may take to be discovered (`readiness`)."""


class TopicListener:
    """A node that listens, by topic and type's name."""

    def __init__(self, name: str, namespace: str, topics: Mapping[str, str]) -> None:
        self.node = Ros2Node(name, namespace)
        self.graph = Graph(self.node)
        self._lock = threading.Lock()
        self._heard = {topic: Heard() for topic in topics}
        for topic, kind in topics.items():
            self.node.rclpy.create_subscription(CLASSES[kind], topic, self._keeper(topic), SENSOR_DATA, raw=True)

    def listen(self, seconds: float) -> dict[str, Heard]:
        """Wait, and return what has come on each topic since the graph was discovered."""
        time.sleep(_CONNECTING_S)
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
            data = self._heard[topic].messages[-1:]
        return planar(deserialize_message(data[0], Odometry))[2] if data else None

    def close(self) -> None:
        """Leave the graph."""
        self.node.close()

    def _keeper(self, topic: str) -> Any:
        def keep(data: bytes, info: Any) -> None:
            sender = self.graph.sender(topic, info)
            with self._lock:
                heard = self._heard[topic]
                heard.arrivals.append(time.time())
                heard.stamps.append(stamp_of_serialized(data))
                heard.messages.append(data)
                heard.senders |= {sender} - {""}
                del heard.messages[:-_KEEP]

        return keep


def message_of(kind: str, data: bytes) -> Any:
    """Return a serialized message of a type such as `sensor_msgs/Image`."""
    return deserialize_message(data, CLASSES[kind.replace("/", "/msg/")])
