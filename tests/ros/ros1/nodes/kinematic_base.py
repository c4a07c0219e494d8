"""A base that follows its commands exactly, publishes odometry, and has commanded faults.

Parameters: ~rate_hz of odometry, ~lag_s from command to motion, ~heading_deg at start, ~command_timeout_s,
~noise_deg and ~noise_m of the odometry, at rest as well. The topic
/base/fault takes a word: `silent`, `nan`, `jump`, `stuck`, `slip` (odometry says half), `bumper`, `cliff`, `drop`,
`raise` (the wheels carry again), `release` (the bumper), `good` (back to normal). /base/truth says where it really is;
its z is the commanded speed, and its w the true one. Like a Kobuki, it reports the state of its hazard sensors too.
Asked to reset its odometry, it zeroes position and heading 30 ms later, as kobuki_driver does.
"""

import math
import random
import threading
import time
from collections import deque

import rospy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Empty, String

from vsnbench.ros.ros1.messages import BumperEvent, CliffEvent, SensorState, WheelDropEvent
from vsnbench.values.pose import Pose

rospy.init_node("kinematic_base")
rate_hz = float(rospy.get_param("~rate_hz", 50))
lag_s = float(rospy.get_param("~lag_s", 0))
timeout_s = float(rospy.get_param("~command_timeout_s", 0.6))
noise_rad, noise_m = math.radians(float(rospy.get_param("~noise_deg", 0))), float(rospy.get_param("~noise_m", 0))
rng = random.Random(3)
pose = Pose.from_degrees(0, 0, float(rospy.get_param("~heading_deg", 0)))
offset_m = 0.0
zero = Pose(0, 0, 0)
reset_due = math.inf
fault = "good"
lock = threading.Lock()
commands: deque = deque()

odometry = rospy.Publisher("/odom", Odometry, queue_size=10, tcp_nodelay=True)
truth = rospy.Publisher("/base/truth", PoseStamped, queue_size=10, tcp_nodelay=True)
bumper = rospy.Publisher("/mobile_base/events/bumper", BumperEvent, queue_size=10)
cliff = rospy.Publisher("/mobile_base/events/cliff", CliffEvent, queue_size=10)
drop = rospy.Publisher("/mobile_base/events/wheel_drop", WheelDropEvent, queue_size=10)
core = rospy.Publisher("/mobile_base/sensors/core", SensorState, queue_size=1)
state = {"bumper": 0, "cliff": 0, "wheel_drop": 0}
STATES = {
    "bumper": ("bumper", 2),
    "release": ("bumper", 0),
    "cliff": ("cliff", 4),
    "floor": ("cliff", 0),
    "drop": ("wheel_drop", 2),
    "raise": ("wheel_drop", 0),
}
EVENTS = {
    "bumper": lambda: bumper.publish(BumperEvent(BumperEvent.CENTER, BumperEvent.PRESSED)),
    "release": lambda: bumper.publish(BumperEvent(BumperEvent.CENTER, BumperEvent.RELEASED)),
    "cliff": lambda: cliff.publish(CliffEvent(CliffEvent.LEFT, CliffEvent.CLIFF, 1500)),
    "floor": lambda: cliff.publish(CliffEvent(CliffEvent.LEFT, CliffEvent.FLOOR, 0)),
    "drop": lambda: drop.publish(WheelDropEvent(WheelDropEvent.LEFT, WheelDropEvent.DROPPED)),
    "raise": lambda: drop.publish(WheelDropEvent(WheelDropEvent.LEFT, WheelDropEvent.RAISED)),
}


def on_fault(message: String) -> None:
    global fault, offset_m
    with lock:
        if message.data in EVENTS:
            EVENTS[message.data]()
            state.update([STATES[message.data]])
        elif message.data == "jump":
            offset_m += 1.5
        else:
            fault = message.data


def on_reset(_message: Empty) -> None:
    global reset_due
    with lock:
        reset_due = time.monotonic() + 0.03


def on_command(twist: Twist) -> None:
    with lock:
        commands.append((time.monotonic() + lag_s, twist))


rospy.Subscriber("/base/fault", String, on_fault, queue_size=10)
rospy.Subscriber("/mobile_base/commands/reset_odometry", Empty, on_reset, queue_size=1)
rospy.Subscriber("/cmd_vel", Twist, on_command, queue_size=50, tcp_nodelay=True)
current, heard = Twist(), 0.0
last = next_odometry = time.monotonic()
while not rospy.is_shutdown():
    time.sleep(0.005)
    now = time.monotonic()
    with lock:
        while commands and commands[0][0] <= now:
            heard, current = commands.popleft()
        moving = now - heard < timeout_s and fault != "stuck"
        linear = current.linear.x if moving else 0.0
        aside = current.linear.y if moving else 0.0
        angular = current.angular.z if moving else 0.0
        elapsed = now - last
        last = now
        share = 0.5 if fault == "slip" else 1.0
        middle = pose.heading_rad + angular * elapsed / 2
        pose = Pose(
            pose.x_m + share * elapsed * (linear * math.cos(middle) - aside * math.sin(middle)),
            pose.y_m + share * elapsed * (linear * math.sin(middle) + aside * math.cos(middle)),
            pose.heading_rad + angular * share * elapsed,
        )
        stamp = rospy.Time.now()
        where = PoseStamped()
        where.header.stamp = stamp
        where.pose.position.x, where.pose.position.y = pose.position
        where.pose.position.z = abs(current.linear.x) + abs(current.linear.y) + abs(current.angular.z)
        where.pose.orientation.z, where.pose.orientation.w = pose.heading_rad, abs(linear) + abs(aside) + abs(angular)
        truth.publish(where)
        if now >= reset_due:
            zero, reset_due = pose, math.inf
        if now < next_odometry or fault == "silent":
            continue
        next_odometry = max(next_odometry + 1 / rate_hz, now)
        message = Odometry()
        message.header.stamp = stamp
        exact = pose.relative_to(zero)
        counted = Pose(
            exact.x_m + rng.gauss(0, noise_m),
            exact.y_m + rng.gauss(0, noise_m),
            exact.heading_rad + rng.gauss(0, noise_rad),
        )
        message.pose.pose.position.x = math.nan if fault == "nan" else counted.x_m + offset_m
        message.pose.pose.position.y = counted.y_m
        message.pose.pose.orientation.z = math.sin(counted.heading_rad / 2)
        message.pose.pose.orientation.w = math.cos(counted.heading_rad / 2)
        odometry.publish(message)
        core.publish(SensorState(battery=160, **state))
