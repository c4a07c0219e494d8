"""A base that takes Twist on /cmd_vel and reports /odom as a `Base`: `python ros2_adapter.py twist:TwistBase`."""

import math
import time

from by_velocity import Base
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data

SILENT_S = 1.0


class TwistBase(Base):
    """Such a base needs no adapter: it shows what one does."""

    card = {"name": "twist-base", "version": "1", "movements": ["move", "waypoint", "trajectory", "velocity"]}  # noqa: RUF012
    pose = None

    def __init__(self, node) -> None:
        self._publisher = node.create_publisher(Twist, "cmd_vel", 10)
        node.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)

    def _on_odometry(self, message: Odometry) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
        self.pose, self._heard_s = (at.x, at.y, heading), time.monotonic()

    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        twist = Twist()
        twist.linear.x, twist.angular.z = forward_m_s, turn_rad_s
        self._publisher.publish(twist)
        return "sensor" if time.monotonic() - self._heard_s > SILENT_S else ""

    def stop(self) -> None:
        self._publisher.publish(Twist())
