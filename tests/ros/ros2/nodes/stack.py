"""A stack of another project: it knows nothing of vsnbench, and drives.

It takes goals by HTTP or as an argument; by a topic, and publishes five times a second or once that it has arrived
(`--ways topic`, `event`); or as an action, like Nav2's bt_navigator: it accepts a goal, and ends it as succeeded,
aborted, or canceled on request (navigation2, nav2_util's SimpleActionServer).

Its path for each goal is in the frame of the robot when the goal arrives. `after` says what it does at the end.
"""

import argparse
import json
import math
import os
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Bool, Empty, String

words = argparse.ArgumentParser()
words.add_argument("root")
words.add_argument("paths", type=json.loads)
words.add_argument("--port", type=int, default=0)
words.add_argument("--goal", default="")
words.add_argument("--after", default="arrive", choices=["arrive", "fail", "wait", "drive-on", "die", "never-begin"])
words.add_argument("--map", type=open)  # ways by goal, in the frame of the site: it knows where it is
words.add_argument("--ways", default="http", choices=["http", "topic", "event", "action"])
words.add_argument("--answer", default="", choices=["", "500", "hang", "huge", "words"])
given = words.parse_args()


class Stack:
    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node("their_stack", namespace=given.root)
        kinds = {"geometry_msgs/msg/Twist": Twist, "geometry_msgs/msg/TwistStamped": TwistStamped}
        topic, self.kind = f"{given.root}/cmd_vel", None
        while self.kind is None:
            known = [kind for info in self.node.get_subscriptions_info_by_topic(topic) if (kind := info.topic_type)]
            self.kind = next((kinds[kind] for kind in known if kind in kinds), None)
            time.sleep(0.1)
        self.publisher = self.node.create_publisher(self.kind, topic, 10)
        self.node.create_subscription(Odometry, f"{given.root}/odom", self.take, qos_profile_sensor_data)
        self.pose = (0.0, 0.0, 0.0)
        self.ways = json.load(given.map) if given.map else {}
        if self.ways:
            self.node.create_subscription(
                Odometry, f"{given.root}/simulation/ground_truth", self.localize, qos_profile_sensor_data
            )
        self.where = (0.0, 0.0)
        self.has_odometry = threading.Event()
        self.is_cancelled = threading.Event()
        self.state: dict[str, object] = {"arrived": False}
        executor = MultiThreadedExecutor(4)
        executor.add_node(self.node)
        threading.Thread(target=executor.spin, daemon=True).start()

    def take(self, message: Odometry) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        self.pose = at.x, at.y, 2 * math.atan2(turn.z, turn.w)
        self.has_odometry.set()

    def localize(self, message: Odometry) -> None:
        self.where = message.pose.pose.position.x, message.pose.pose.position.y

    def path_to(self, goal: str) -> list[list[float]]:
        """Return a path in the robot's frame: the given one, or the way that begins where it is."""
        if not self.ways:
            return given.paths[goal]
        way = min(self.ways[goal], key=lambda way: math.dist(way[0][:2], self.where))
        x0, y0, heading0 = way[0]
        cos, sin = math.cos(heading0), math.sin(heading0)
        return [[cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0)] for x, y, _ in way[1:]]

    def send(self, linear_m_s: float, angular_rad_s: float) -> None:
        message = self.kind()
        twist = message.twist if self.kind is TwistStamped else message
        if self.kind is TwistStamped:
            message.header.stamp = self.node.get_clock().now().to_msg()
        twist.linear.x, twist.angular.z = linear_m_s, angular_rad_s
        self.publisher.publish(message)
        time.sleep(0.05)

    def drive(self, goal: str) -> None:
        self.state, self.is_cancelled = {"arrived": False}, threading.Event()
        if given.after == "never-begin":
            return
        self.has_odometry.wait(10)
        x0, y0, heading0 = self.pose
        for x_m, y_m in self.path_to(goal):
            to_x = x0 + x_m * math.cos(heading0) - y_m * math.sin(heading0)
            to_y = y0 + x_m * math.sin(heading0) + y_m * math.cos(heading0)
            while not self.is_cancelled.is_set():
                x, y, heading = self.pose
                left_m = math.dist((x, y), (to_x, to_y))
                off_rad = math.remainder(math.atan2(to_y - y, to_x - x) - heading, math.tau)
                if left_m < 0.05:
                    break
                self.send(0.25 if abs(off_rad) < 0.3 else 0.0, max(-0.8, min(0.8, 2 * off_rad)))
        if self.is_cancelled.is_set():
            self.send(0.0, 0.0)
            return
        if given.after == "die":
            os._exit(3)
        if given.ways == "event" and given.after == "arrive":
            self.arrival.publish(Bool(data=True))
        if given.after == "fail":
            self.state = {"arrived": False, "failed": "no path to the goal"}
        if given.after in ("arrive", "drive-on"):
            self.state = {"arrived": True}
        if given.after == "drive-on":
            ends_s = time.monotonic() + 5
            while time.monotonic() < ends_s:
                self.send(0.25, 0.0)
        self.send(0.0, 0.0)

    def serve_topics(self) -> None:
        """Take goals on a topic, and say on another one whether the last one has been reached."""
        self.arrival = self.node.create_publisher(Bool, f"{given.root}/their/arrived", 10)
        self.node.create_subscription(String, f"{given.root}/their/goal", self.take_goal, 10)
        self.node.create_subscription(Empty, f"{given.root}/their/abort", self.take_abort, 10)
        if given.ways == "topic":
            self.node.create_timer(0.2, lambda: self.arrival.publish(Bool(data=bool(self.state["arrived"]))))

    def take_goal(self, message: String) -> None:
        print("goal", message.data, flush=True)
        threading.Timer(0.3, self.drive, (message.data,)).start()  # its old state stays for a moment

    def take_abort(self, _: Empty) -> None:
        print("abort", flush=True)
        self.is_cancelled.set()

    def serve_action(self) -> None:
        """Take goals as an action whose `order` is the number of the path."""
        from test_msgs.action import Fibonacci

        def execute(handle) -> Fibonacci.Result:  # type: ignore[no-untyped-def]
            goal = list(given.paths or self.ways)[handle.request.order]
            print("goal", goal, flush=True)
            self.drive(goal)
            if handle.is_cancel_requested:
                handle.canceled()
            elif self.state["arrived"]:
                handle.succeed()
            else:
                handle.abort()
            return Fibonacci.Result()

        def cancel(_: object) -> CancelResponse:
            print("abort", flush=True)
            self.is_cancelled.set()
            return CancelResponse.ACCEPT

        self.server = ActionServer(
            self.node,
            Fibonacci,
            f"{given.root}/navigate",
            execute,
            cancel_callback=cancel,
            callback_group=ReentrantCallbackGroup(),
        )


class Handler(BaseHTTPRequestHandler):
    def answer(self, status: int, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        if self.path == "/goal":
            goal = json.loads(body)["goal"]
            print("goal", goal, flush=True)
            threading.Thread(target=stack.drive, args=(goal,), daemon=True).start()
        else:
            print("abort", flush=True)
            stack.is_cancelled.set()
        self.answer(200, b"")

    def do_GET(self) -> None:
        if given.answer == "hang":
            time.sleep(60)
        if given.answer == "huge":
            self.send_response(200)
            self.send_header("Content-Length", str(10 * 2**30))
            self.end_headers()
            for _ in range(10 * 2**10):
                self.wfile.write(bytes(2**20))
        self.answer(int(given.answer) if given.answer.isdigit() else 200, json.dumps(stack.state).encode())

    def log_message(self, *_: object) -> None:
        pass


stack = Stack()
if given.goal:
    stack.drive(given.goal)
    os._exit(0 if stack.state["arrived"] else 4)  # the thread of rclpy would abort the process
if given.ways == "action":
    stack.serve_action()
elif given.ways != "http":
    stack.serve_topics()
server = ThreadingHTTPServer(("127.0.0.1", given.port), Handler)
print("listens", server.server_port, flush=True)
server.serve_forever()
