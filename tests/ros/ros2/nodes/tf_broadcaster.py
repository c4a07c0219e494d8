"""Publishes the odometry of `odom` as TF: odom to base_footprint, moving, and base_footprint to base_link, fixed.

`--no-fixed` leaves the fixed link out.
"""

import sys
import threading

from vsnbench.ros.ros2.installation import require_ros2

require_ros2()
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from vsnbench.ros.ros2.node import LATCHED, RELIABLE, SENSOR_DATA, Ros2Node

node = Ros2Node("tf_broadcaster")
make = node.rclpy
moving = make.create_publisher(TFMessage, "/tf", RELIABLE)
fixed = make.create_publisher(TFMessage, "/tf_static", LATCHED)


def link(parent: str, child: str) -> TransformStamped:
    made = TransformStamped(child_frame_id=child)
    made.header.frame_id = parent
    return made


def on_odometry(message: Odometry) -> None:
    moved, pose = link("odom", "base_footprint"), message.pose.pose
    moved.header.stamp, moved.transform.rotation = message.header.stamp, pose.orientation
    moved.transform.translation.x, moved.transform.translation.y = pose.position.x, pose.position.y
    moving.publish(TFMessage(transforms=[moved]))


if "--no-fixed" not in sys.argv:
    mount = link("base_footprint", "base_link")
    mount.transform.translation.z = 0.04
    fixed.publish(TFMessage(transforms=[mount]))
make.create_subscription(Odometry, "odom", on_odometry, SENSOR_DATA)
sys.stdout.write("up\n")
sys.stdout.flush()
threading.Event().wait()
