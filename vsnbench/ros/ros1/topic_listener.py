"""Collects the messages of topics over ROS 1."""

import struct
from collections.abc import Callable, Iterable
from typing import Any

import rospy

from vsnbench.ros.common import topic_listener
from vsnbench.ros.common.odometry import TakeOdometry
from vsnbench.ros.ros1.messages import MESSAGE_CLASSES
from vsnbench.ros.ros1.node import start_node
from vsnbench.ros.ros1.odometry import OdometrySubscription, sender_of


def message_of(kind: str, data: bytes) -> Any:
    """Return a serialized message of a type such as `sensor_msgs/Image`."""
    return MESSAGE_CLASSES[kind]().deserialize(data)


class TopicListener(topic_listener.TopicListener):
    """A node that records the serialized messages of several topics; one per process."""

    connecting_s = 0.5

    def __init__(self, name: str, topics: Iterable[str]) -> None:
        super().__init__(topics)
        start_node(name)
        for topic in topics:
            rospy.Subscriber(topic, rospy.AnyMsg, self._recorder(topic), queue_size=50, buff_size=1 << 24)

    def follow_odometry(self, names: Any, take: TakeOdometry[str]) -> OdometrySubscription:
        """Pass the odometry of a base to `take`."""
        return OdometrySubscription(names, take)

    def close(self) -> None:
        """Leave the ROS network."""
        rospy.signal_shutdown("closed")

    def _recorder(self, topic: str) -> Callable[[Any], None]:
        def record(message: Any) -> None:
            arrival_s, data = rospy.get_time(), message._buff  # noqa: SLF001
            secs, nsecs = struct.unpack_from("<II", data, 4) if len(data) >= 12 else (0, 0)
            self.monitor.add(topic, data, sender_of(message), arrival_s=arrival_s, stamp_s=secs + nsecs * 1e-9)

        return record
