"""Subscriptions to the topics of a robot over ROS 1: its odometry and battery, and any topics for the check-up."""

import struct
from collections.abc import Callable, Iterable
from typing import Any

import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from vsnbench.ros.common.odometry import OdometryReader, TakeAttitude, TakeOdometry
from vsnbench.ros.common.topic_listener import TopicListener
from vsnbench.ros.ros1.interface import Ros1Interface
from vsnbench.ros.ros1.messages import MESSAGE_CLASSES, TFMessage, battery_in
from vsnbench.ros.ros1.node import leave_network, start_node
from vsnbench.values.battery import Battery

_TF_QUEUE = 100


class Ros1Odometry(OdometryReader[str]):
    """Passes the odometry of a base to `take`, with the name of the sending node."""

    def __init__(
        self,
        names: Ros1Interface,
        take: TakeOdometry[str],
        queue_size: int = 20,
        take_attitude: TakeAttitude | None = None,
    ) -> None:
        super().__init__(names, take, take_attitude)
        if names.tf is None:
            topics = [(names.odometry, Odometry, self._on_odometry, queue_size)]
        else:
            topics = [
                (names.tf.static_topic, TFMessage, self.take_fixed_links, _TF_QUEUE),
                (names.tf.topic, TFMessage, self._on_links, _TF_QUEUE),
            ]
        if self.imu:
            topics.append((self.imu, Imu, self.take_imu, queue_size))
        for topic, kind, take_message, size in topics:
            rospy.Subscriber(topic, kind, take_message, queue_size=size, tcp_nodelay=True)

    def _seconds(self, stamp: Any) -> float:
        return float(stamp.to_sec())

    def _on_odometry(self, message: Any) -> None:
        self.take_odometry(message, sender_of(message))

    def _on_links(self, message: Any) -> None:
        self.take_moving_links(message, sender_of(message))


def sender_of(message: Any) -> str:
    """Return the node that published a message."""
    return str(message._connection_header.get("callerid", "?"))  # noqa: SLF001


def subscribe_battery(names: Ros1Interface, take: Callable[[Battery | None], None]) -> None:
    """Pass every battery report of a base to `take`."""
    if names.battery:
        kind = MESSAGE_CLASSES[names.battery_type]
        rospy.Subscriber(names.battery, kind, lambda message: take(battery_in(message)), queue_size=1)


def message_of(kind: str, data: bytes) -> Any:
    """Return a serialized message of a type such as `sensor_msgs/Image`."""
    return MESSAGE_CLASSES[kind]().deserialize(data)


class Ros1Listener(TopicListener):
    """A node that records the serialized messages of several topics; one per process."""

    connecting_s = 0.5

    def __init__(self, name: str, topics: Iterable[str]) -> None:
        super().__init__(topics)
        start_node(name)
        for topic in topics:
            rospy.Subscriber(topic, rospy.AnyMsg, self._recorder(topic), queue_size=50, buff_size=1 << 24)

    def follow_odometry(self, names: Any, take: TakeOdometry[str]) -> Ros1Odometry:
        """Pass the odometry of a base to `take`."""
        return Ros1Odometry(names, take)

    def close(self) -> None:
        """Leave the ROS network."""
        leave_network()

    def _recorder(self, topic: str) -> Callable[[Any], None]:
        def record(message: Any) -> None:
            arrival_s, data = rospy.get_time(), message._buff  # noqa: SLF001
            secs, nsecs = struct.unpack_from("<II", data, 4) if len(data) >= 12 else (0, 0)
            self.monitor.add(topic, data, sender_of(message), arrival_s=arrival_s, stamp_s=secs + nsecs * 1e-9)

        return record
