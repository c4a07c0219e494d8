"""A base and a camera over ROS 2, controlled by lines on stdin.

It prints the times when it `moves` or `stands`, and when it is `commanded` to move or to zero (`zeroed`).

Base: `silent`, `nan`, `jump`, `stuck`, `bumper`, `cliff`, `release`, `timeout S`. Camera: `blind`, `small`, `past`,
`frozen` (the same colours with new stamps), `half` (no depth in the left half), `slow` (one image per second), `late`
(0.3 s after its stamp); `frozen+half` is both. `apart S`: every camera sends five images a second, the left one's are
stamped S earlier; `apart S N`: only each Nth of them. Either: `good`; `where` says where the base truly is. Arguments:
`--stamped` listens to TwistStamped, `--noise DEG M` is white noise of the odometry, at rest as well.
"""

import argparse
import math
import queue
import random
import sys
import threading
import time

import numpy as np

from vsnbench.ros.ros2.installation import require_ros2
from vsnbench.values.pose import Pose

require_ros2()
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import DockStatus, HazardDetectionVector, hazard_vector
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image
from std_msgs.msg import Bool

from vsnbench.ros.ros2.messages import image_message, odometry_message, twist_of
from vsnbench.ros.ros2.node import SENSOR_DATA, Ros2Node

options = argparse.ArgumentParser()
options.add_argument("--stamped", action="store_true")
options.add_argument("--noise", nargs=2, type=float, default=(0.0, 0.0))
chosen = options.parse_args()
node = Ros2Node("test_robot")
make = node.rclpy
odometry = make.create_publisher(Odometry, "odom", SENSOR_DATA)
bumper = make.create_publisher(Bool, "bumper", SENSOR_DATA)
hazards = make.create_publisher(HazardDetectionVector, "hazard_detection", SENSOR_DATA)
dock = make.create_publisher(DockStatus, "dock_status", SENSOR_DATA)
left_color = make.create_publisher(Image, "camera_left/color/image_raw", SENSOR_DATA)
left_depth = make.create_publisher(Image, "camera_left/depth/image_raw", SENSOR_DATA)
color = make.create_publisher(Image, "camera/color/image_raw", SENSOR_DATA)
depth = make.create_publisher(Image, "camera/depth/image_raw", SENSOR_DATA)
heard: queue.SimpleQueue = queue.SimpleQueue()
told: queue.SimpleQueue = queue.SimpleQueue()
kind = TwistStamped if chosen.stamped else Twist
make.create_subscription(kind, "cmd_vel", lambda message: heard.put(twist_of(message)), SENSOR_DATA)
threading.Thread(target=lambda: [told.put(line.split()) for line in sys.stdin], daemon=True).start()

noise_rad, noise_m, draws = math.radians(chosen.noise[0]), chosen.noise[1], random.Random(3)
sys.stdout.write("up\n")
sys.stdout.flush()
pose, offset_m, fault, timeout_s = Pose(0.0, 0.0, 0.6), 0.0, "good", 1000.0
apart_s: float | None = None
every, images = 1, 0
rng, colors = np.random.default_rng(0), None
current, heard_s, moved, commanded = Twist(), -math.inf, False, False
pressed, cliffs = False, ()
last = odometry_due = camera_due = time.monotonic()
while True:
    time.sleep(0.005)
    now = time.monotonic()
    while not told.empty():
        word, *rest = told.get()
        if word in ("bumper", "release"):
            pressed = word == "bumper"
            cliffs = () if word == "release" else cliffs
            bumper.publish(Bool(data=pressed))
            hazards.publish(hazard_vector(*cliffs))
        elif word == "cliff":
            cliffs = ((2, "cliff_front_left"),)
            hazards.publish(hazard_vector(*cliffs))
        elif word == "jump":
            offset_m += 1.5
        elif word == "where":
            sys.stdout.write(f"at {pose.x_m} {pose.y_m} {pose.heading_deg}\n")
            sys.stdout.flush()
        elif word == "timeout":
            timeout_s = float(rest[0])
        elif word == "apart":
            apart_s, every = float(rest[0]), int(rest[1]) if rest[1:] else 1
        else:
            fault = word
    while not heard.empty():
        current, heard_s = heard.get(), now
        if (asked := bool(current.linear.x or current.linear.y or current.angular.z)) != commanded:
            commanded = asked
            sys.stdout.write(f"{'commanded' if asked else 'zeroed'} {now}\n")
            sys.stdout.flush()
    drives = now - heard_s < timeout_s and fault != "stuck"
    linear, aside, angular = (current.linear.x, current.linear.y, current.angular.z) if drives else (0.0, 0.0, 0.0)
    if (moving := bool(linear or aside or angular)) != moved:
        moved = moving
        sys.stdout.write(f"{'moves' if moving else 'stands'} {now}\n")
        sys.stdout.flush()
    elapsed, last = now - last, now
    middle = pose.heading_rad + angular * elapsed / 2
    pose = Pose(
        pose.x_m + elapsed * (linear * math.cos(middle) - aside * math.sin(middle)),
        pose.y_m + elapsed * (linear * math.sin(middle) + aside * math.cos(middle)),
        pose.heading_rad + angular * elapsed,
    )
    stamp_s = time.time()
    if now >= odometry_due and fault != "silent":
        odometry_due = max(odometry_due + 0.02, now)
        x_m, y_m = pose.x_m + offset_m + draws.gauss(0, noise_m), pose.y_m + draws.gauss(0, noise_m)
        message = odometry_message(Pose(x_m, y_m, pose.heading_rad + draws.gauss(0, noise_rad)), stamp_s, "odom")
        if fault == "nan":
            message.pose.pose.position.x = math.nan
        odometry.publish(message)
        dock.publish(DockStatus(data=False))
        bumper.publish(Bool(data=pressed))  # a base of ROS 2 publishes the state of its sensors all the time
        hazards.publish(hazard_vector(*cliffs))
    if now >= camera_due and fault != "blind":
        camera_due = max(camera_due + (1.0 if "slow" in fault else 1 / 30 if apart_s is None else 0.2), now)
        taken_s = stamp_s - (3600 if fault == "past" else 0.3 if "late" in fault else 0)
        size = (24, 32) if fault == "small" else (48, 64)
        if colors is None or "frozen" not in fault:
            colors = rng.integers(88, 93, (*size, 3), np.uint8)
        wall = rng.integers(1999, 2002, size, np.uint16)
        if "half" in fault:
            wall[:, :32] = 0
        color.publish(image_message(colors, "rgb8", taken_s))
        depth.publish(image_message(wall, "16UC1", taken_s))
        images += 1
        if apart_s is not None and images % every == 0:
            left_color.publish(image_message(colors, "rgb8", taken_s - apart_s))
            left_depth.publish(image_message(wall, "16UC1", taken_s - apart_s))
