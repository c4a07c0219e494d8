"""Robots that a session must refuse, one per namespace, all in this process: `refused_robots.py`.

`deaf` subscribes to no velocities, `lasting` needs latched velocities, `stamped` subscribes to TwistStamped, `docked`
is on its dock, and `two` has two robots. None may ever move: it would print that.
"""

import sys
import time

import numpy as np

from vsnbench.ros.ros2.installation import require_ros2
from vsnbench.values.pose import Pose

require_ros2()
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import DockStatus
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image

from vsnbench.ros.ros2.messages import image_message, odometry_message, twist_of
from vsnbench.ros.ros2.node import LATCHED, SENSOR_DATA, Ros2Node

_PERIOD_S = 0.2


class Robot:
    def __init__(self, namespace: str, name: str = "test_robot", kind: type | None = Twist) -> None:
        self.node = Ros2Node(name, namespace)
        make = self.node.rclpy
        self.odometry = make.create_publisher(Odometry, "odom", SENSOR_DATA)
        self.dock = make.create_publisher(DockStatus, "dock_status", SENSOR_DATA)
        self.color = make.create_publisher(Image, "camera/color/image_raw", SENSOR_DATA)
        self.depth = make.create_publisher(Image, "camera/depth/image_raw", SENSOR_DATA)
        self.docked = namespace == "docked"
        if kind is not None:
            asked = LATCHED if namespace == "lasting" else SENSOR_DATA
            make.create_subscription(kind, "cmd_vel", self.hear, asked)

    def hear(self, message: Twist | TwistStamped) -> None:
        twist = twist_of(message)
        if twist.linear.x or twist.angular.z:
            sys.stdout.write(f"{self.node.full_name} moves\n")
            sys.stdout.flush()

    def tell(self, stamp_s: float) -> None:
        self.odometry.publish(odometry_message(Pose(0.0, 0.0, 0.6), stamp_s, "odom"))
        self.dock.publish(DockStatus(data=self.docked))
        self.color.publish(image_message(np.full((48, 64, 3), 90, np.uint8), "rgb8", stamp_s))
        self.depth.publish(image_message(np.full((48, 64), 2000, np.uint16), "16UC1", stamp_s))


robots = [
    *(Robot("deaf", kind=None), Robot("lasting"), Robot("stamped", kind=TwistStamped), Robot("docked")),
    *(Robot("two"), Robot("two", "second_robot")),
]
sys.stdout.write("up\n")
sys.stdout.flush()
while True:
    for robot in robots:
        robot.tell(time.time())
    time.sleep(_PERIOD_S)
