"""Subscription to the odometry of a base over ROS 1."""

from typing import Any

import rospy
from nav_msgs.msg import Odometry

from vsnbench.ros.common.odometry import OdometryReader, TakeOdometry
from vsnbench.ros.ros1.interface import Ros1Interface
from vsnbench.ros.ros1.messages import TFMessage

_TF_QUEUE = 100


class OdometrySubscription(OdometryReader[str]):
    """Passes the odometry of a base to `take`, with the name of the sending node."""

    def __init__(self, names: Ros1Interface, take: TakeOdometry[str], queue_size: int = 20) -> None:
        super().__init__(names, take)
        if names.tf is None:
            topics = [(names.odometry, Odometry, self._on_odometry, queue_size)]
        else:
            topics = [
                (names.tf.static_topic, TFMessage, self.take_fixed_links, _TF_QUEUE),
                (names.tf.topic, TFMessage, self._on_links, _TF_QUEUE),
            ]
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
