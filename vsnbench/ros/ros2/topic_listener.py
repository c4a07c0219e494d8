"""Collects the messages of topics over ROS 2."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import BatteryState, CameraInfo, CompressedImage, Image

from vsnbench.ros.common import topic_listener
from vsnbench.ros.common.odometry import TakeOdometry
from vsnbench.ros.ros2.graph import Graph
from vsnbench.ros.ros2.messages import stamp_of_serialized
from vsnbench.ros.ros2.node import SENSOR_DATA, Ros2Node
from vsnbench.ros.ros2.odometry import OdometrySubscription

_CLASSES: Mapping[str, Any] = {
    "nav_msgs/msg/Odometry": Odometry,
    "sensor_msgs/msg/Image": Image,
    "sensor_msgs/msg/CameraInfo": CameraInfo,
    "sensor_msgs/msg/CompressedImage": CompressedImage,
    "sensor_msgs/msg/BatteryState": BatteryState,
}


def message_of(kind: str, data: bytes) -> Any:
    """Return a serialized message of a type such as `sensor_msgs/Image`."""
    return deserialize_message(data, _CLASSES[kind.replace("/", "/msg/")])


class TopicListener(topic_listener.TopicListener):
    """A node that records the serialized messages of several topics."""

    connecting_s = 1.5  # with the time of listening, as long as discovery takes (`readiness`)

    def __init__(self, name: str, namespace: str, topics: Mapping[str, str]) -> None:
        super().__init__(topics)
        self.node = Ros2Node(name, namespace)
        self.graph = Graph(self.node)
        for topic, kind in topics.items():
            self.node.rclpy.create_subscription(_CLASSES[kind], topic, self._recorder(topic), SENSOR_DATA, raw=True)

    def follow_odometry(self, names: Any, take: TakeOdometry[str]) -> OdometrySubscription:
        """Pass the odometry of a base to `take`.

        Raises:
            RobotError: the source is TF, and its message type is not installed.
        """

        def with_sender(pose: tuple[float, float, float], stamp_s: float, info: Any) -> None:
            take(pose, stamp_s, self.graph.sender(names.odometry_topic, info))

        return OdometrySubscription(self.node, names, with_sender)

    def close(self) -> None:
        """Leave the graph."""
        self.node.close()

    def _recorder(self, topic: str) -> Callable[[bytes, Any], None]:
        def record(data: bytes, info: Any) -> None:
            arrival_s, sender = time.time(), self.graph.sender(topic, info)
            self.monitor.add(topic, data, sender, arrival_s=arrival_s, stamp_s=stamp_of_serialized(data))

        return record
