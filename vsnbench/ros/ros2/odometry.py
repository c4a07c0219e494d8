"""Subscription to the odometry of a base over ROS 2."""

from typing import Any

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy

from vsnbench.ros.common.interface import OdometryFrames
from vsnbench.ros.common.messages import fill_transform
from vsnbench.ros.common.odometry import OdometryReader, TakeOdometry
from vsnbench.ros.ros2.installation import require_tf_message
from vsnbench.ros.ros2.interface import Ros2Interface
from vsnbench.ros.ros2.messages import seconds
from vsnbench.ros.ros2.node import SENSOR_DATA, Ros2Node

_MOVING = QoSProfile(depth=100, reliability=QoSReliabilityPolicy.BEST_EFFORT, durability=QoSDurabilityPolicy.VOLATILE)
_FIXED = QoSProfile(
    depth=100, reliability=QoSReliabilityPolicy.RELIABLE, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL
)
"""Fixed links are published once; a late subscriber requests them again."""


class OdometrySubscription(OdometryReader[Any]):
    """Passes the odometry of a base to `take`, with the message info of rclpy as its sender.

    Raises:
        RobotError: the source is TF, and its message type is not installed.
    """

    def __init__(self, node: Ros2Node, names: Ros2Interface, take: TakeOdometry[Any]) -> None:
        super().__init__(names, take)
        subscribe = node.rclpy.create_subscription
        if names.tf is None:
            subscribe(Odometry, names.odometry, self.take_odometry, SENSOR_DATA)
        else:
            kind = require_tf_message()
            subscribe(kind, names.tf.static_topic, self.take_fixed_links, _FIXED)
            subscribe(kind, names.tf.topic, self.take_moving_links, _MOVING)

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
