"""A stack of another project over ROS 1: it knows nothing of vsnbench.

It takes goals and aborts on topics, and publishes its state five times a second: idle, driving, arrived or failed, like
the status of move_base. Its path for each goal is in the frame of the robot when the goal arrives. With a file of ways
in the frame of the site, it is the way that begins where the robot is.
"""

import json
import math
import sys
import threading

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Empty, String

PATHS = json.loads(sys.argv[1])
WAYS = json.load(open(sys.argv[3])) if len(sys.argv) > 3 else {}  # noqa: PTH123, SIM115
AFTER = sys.argv[2]
"""What it says at the end of a path."""


class Stack:
    def __init__(self) -> None:
        self.state, self.pose, self.is_cancelled = "idle", None, threading.Event()
        self.commands = rospy.Publisher("/mobile_base/commands/velocity", Twist, queue_size=1)
        self.states = rospy.Publisher("/their/state", String, queue_size=1)
        rospy.Subscriber("/odom", Odometry, self.take)
        self.where = (0.0, 0.0)
        if WAYS:
            rospy.Subscriber("/simulation/ground_truth", Odometry, self.localize)
        rospy.Subscriber("/their/goal", String, self.take_goal)
        rospy.Subscriber("/their/abort", Empty, self.take_abort)

    def take(self, message: Odometry) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        self.pose = at.x, at.y, 2 * math.atan2(turn.z, turn.w)

    def localize(self, message: Odometry) -> None:
        self.where = message.pose.pose.position.x, message.pose.pose.position.y

    def path_to(self, goal: str) -> list[list[float]]:
        if not WAYS:
            return PATHS[goal]
        way = min(WAYS[goal], key=lambda way: math.dist(way[0][:2], self.where))
        x0, y0, heading0 = way[0]
        cos, sin = math.cos(heading0), math.sin(heading0)
        return [[cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0)] for x, y, _ in way[1:]]

    def take_goal(self, message: String) -> None:
        print("goal", message.data, flush=True)
        self.is_cancelled = threading.Event()
        threading.Timer(0.3, self.drive, (message.data, self.is_cancelled)).start()  # its old state stays for a moment

    def take_abort(self, _: Empty) -> None:
        print("abort", flush=True)
        self.is_cancelled.set()

    def send(self, linear_m_s: float, angular_rad_s: float) -> None:
        message = Twist()
        message.linear.x, message.angular.z = linear_m_s, angular_rad_s
        self.commands.publish(message)

    def drive(self, goal: str, is_cancelled: threading.Event) -> None:
        self.state = "driving"
        x0, y0, heading0 = self.pose
        for x_m, y_m in self.path_to(goal):
            to_x = x0 + x_m * math.cos(heading0) - y_m * math.sin(heading0)
            to_y = y0 + x_m * math.sin(heading0) + y_m * math.cos(heading0)
            while not is_cancelled.is_set():
                x, y, heading = self.pose
                off_rad = math.remainder(math.atan2(to_y - y, to_x - x) - heading, math.tau)
                if math.dist((x, y), (to_x, to_y)) < 0.05:
                    break
                self.send(0.25 if abs(off_rad) < 0.3 else 0.0, max(-0.8, min(0.8, 2 * off_rad)))
                rospy.rostime.wallsleep(0.05)
        self.send(0.0, 0.0)
        self.state = "idle" if is_cancelled.is_set() else AFTER


rospy.init_node("their_stack", disable_signals=True)
stack = Stack()
print("listens", flush=True)
while True:
    stack.states.publish(String(stack.state))
    rospy.rostime.wallsleep(0.2)
