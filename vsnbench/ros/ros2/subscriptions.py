"""Subscriptions to the topics of a robot over ROS 2: its odometry, and any topics for the check-up."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import BatteryState, CameraInfo, CompressedImage, Image, Imu

from vsnbench.ros.common.interface import OdometryFrames
from vsnbench.ros.common.messages import fill_transform
from vsnbench.ros.common.odometry import OdometryReader, TakeAttitude, TakeOdometry
from vsnbench.ros.common.topic_listener import TopicListener
from vsnbench.ros.ros2.graph import Graph
from vsnbench.ros.ros2.installation import require_tf_message
from vsnbench.ros.ros2.interface import Ros2Interface
from vsnbench.ros.ros2.messages import seconds, stamp_of_serialized
from vsnbench.ros.ros2.node import SENSOR_DATA, Ros2Node

_MOVING = QoSProfile(depth=100, reliability=QoSReliabilityPolicy.BEST_EFFORT, durability=QoSDurabilityPolicy.VOLATILE)
_FIXED = QoSProfile(
    depth=100, reliability=QoSReliabilityPolicy.RELIABLE, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL
)
"""Fixed links are published once; a late subscriber requests them again."""


class Ros2Odometry(OdometryReader[Any]):
    """Passes the odometry of a base to `take`, with the message info of rclpy as its sender.

    Raises:
        RobotError: the source is TF, and its message type is not installed.
    """

    def __init__(
        self, node: Ros2Node, names: Ros2Interface, take: TakeOdometry[Any], take_attitude: TakeAttitude | None = None
    ) -> None:
        super().__init__(names, take, take_attitude)
        subscribe = node.rclpy.create_subscription
        if names.tf is None:
            subscribe(Odometry, names.odometry, self.take_odometry, SENSOR_DATA)
        else:
            kind = require_tf_message()
            subscribe(kind, names.tf.static_topic, self.take_fixed_links, _FIXED)
            subscribe(kind, names.tf.topic, self.take_moving_links, _MOVING)
        if self.imu:
            subscribe(Imu, self.imu, self.take_imu, SENSOR_DATA)

    def _seconds(self, stamp: Any) -> float:
        return seconds(stamp)


def tf_message(odometry: Any, frames: OdometryFrames) -> Any:
    """Return a nav_msgs/Odometry as the transform between two frames.

    Raises:
        RobotError: the message type of TF is not installed.
    """
    transform = TransformStamped()
    fill_transform(transform, odometry, frames.odom_frame, frames.base_frame)
    return require_tf_message()(transforms=[transform])


_CLASSES: Mapping[str, Any] = {
    "nav_msgs/msg/Odometry": Odometry,
    "sensor_msgs/msg/Image": Image,
    "sensor_msgs/msg/CameraInfo": CameraInfo,
    "sensor_msgs/msg/CompressedImage": CompressedImage,
    "sensor_msgs/msg/BatteryState": BatteryState,
    "sensor_msgs/msg/Imu": Imu,
}


def message_of(kind: str, data: bytes) -> Any:
    """Return a serialized message of a type such as `sensor_msgs/Image`."""
    return deserialize_message(data, _CLASSES[kind.replace("/", "/msg/")])


class Ros2Listener(TopicListener):
    """A node that records the serialized messages of several topics."""

    connecting_s = 1.5  # with the time of listening, as long as discovery takes (`readiness`)

    def __init__(self, name: str, namespace: str, topics: Mapping[str, str]) -> None:
        super().__init__(topics)
        self.node = Ros2Node(name, namespace)
        self.graph = Graph(self.node)
        for topic, kind in topics.items():
            self.node.rclpy.create_subscription(_CLASSES[kind], topic, self._recorder(topic), SENSOR_DATA, raw=True)

    def follow_odometry(self, names: Any, take: TakeOdometry[str]) -> Ros2Odometry:
        """Pass the odometry of a base to `take`.

        Raises:
            RobotError: the source is TF, and its message type is not installed.
        """

        def with_sender(pose: tuple[float, float, float], stamp_s: float, info: Any) -> None:
            take(pose, stamp_s, self.graph.sender(names.odometry_topic, info))

        return Ros2Odometry(self.node, names, with_sender)

    def close(self) -> None:
        """Leave the graph."""
        self.node.close()

    def _recorder(self, topic: str) -> Callable[[bytes, Any], None]:
        def record(data: bytes, info: Any) -> None:
            arrival_s, sender = time.time(), self.graph.sender(topic, info)
            self.monitor.add(topic, data, sender, arrival_s=arrival_s, stamp_s=stamp_of_serialized(data))

        return record
