"""Listens to the topics of a robot: how often something comes, how old it is, and the last messages as bytes.

Imported only where ROS 2 is installed.
"""

import time
from collections.abc import Mapping
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import BatteryState, CameraInfo, Image

from vsnbench.ros2.graph import Graph
from vsnbench.ros2.messages import stamp_of_serialized
from vsnbench.ros2.node import SENSOR_DATA, Ros2Node
from vsnbench.sensing.heard import Heard, Hearing

CLASSES: Mapping[str, Any] = {
    "nav_msgs/msg/Odometry": Odometry,
    "sensor_msgs/msg/Image": Image,
    "sensor_msgs/msg/CameraInfo": CameraInfo,
    "sensor_msgs/msg/BatteryState": BatteryState,
}
_CONNECTING_S = 1.5
"""With the time of listening, what the graph may take to be discovered (`readiness`)."""


class TopicListener:
    """A node that listens, by topic and type's name."""

    def __init__(self, name: str, namespace: str, topics: Mapping[str, str]) -> None:
        self.node = Ros2Node(name, namespace)
        self.graph = Graph(self.node)
        self._hearing = Hearing(topics)
        for topic, kind in topics.items():
            self.node.rclpy.create_subscription(CLASSES[kind], topic, self._keeper(topic), SENSOR_DATA, raw=True)

    def listen(self, seconds: float) -> dict[str, Heard]:
        """Wait, and return what has come on each topic since the graph was discovered."""
        return self._hearing.listen(_CONNECTING_S, seconds)

    def close(self) -> None:
        """Leave the graph."""
        self.node.close()

    def _keeper(self, topic: str) -> Any:
        def keep(data: bytes, info: Any) -> None:
            arrival_s, sender = time.time(), self.graph.sender(topic, info)
            self._hearing.keep(topic, data, sender, arrival_s=arrival_s, stamp_s=stamp_of_serialized(data))

        return keep


def message_of(kind: str, data: bytes) -> Any:
    """Return a serialized message of a type such as `sensor_msgs/Image`."""
    return deserialize_message(data, CLASSES[kind.replace("/", "/msg/")])
