"""Delays all messages between a ROS 2 robot and its client, in order, in both directions.

    python benchmarks/nodes/delaying_relay.py PROFILE DELAY_S JITTER_S SERVER

The robot uses the namespace `near`, its client the namespace `far`. DELAY_S is the mean delay in seconds. Its random
part is exponential with mean JITTER_S, as on a shared Wi-Fi. SERVER is `vsnbench` if a discrete_move node runs next to
the base.
"""

import heapq
import itertools
import random
import sys
import threading
import time

from vsnbench.robots.profiles import load_profile
from vsnbench.ros.ros2.installation import require_ros2

require_ros2()
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image
from std_msgs.msg import String

from vsnbench.ros.ros2.interface import ros2_interface
from vsnbench.ros.ros2.node import LATCHED, RELIABLE, SENSOR_DATA, Ros2Node
from vsnbench.sensing.simulation import ACCOUNT, GROUND_TRUTH, PLACE

profile, delay_s, jitter_s, server = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
node = Ros2Node("wifi")
changed = threading.Condition()
waiting: list = []
number = itertools.count()
chance = random.Random(0)


def pass_on(kind: type, source: str, target: str, heard: object, sent: object, one_in: int = 1) -> None:
    publisher = node.rclpy.create_publisher(kind, target, sent)
    newest_s, count = 0.0, 0

    def hold_back(data: bytes) -> None:
        nonlocal newest_s, count
        count += 1
        if count % one_in:
            return
        newest_s = max(newest_s, time.monotonic() + delay_s - jitter_s + chance.expovariate(1 / jitter_s))
        with changed:
            heapq.heappush(waiting, (newest_s, next(number), publisher, data))
            changed.notify()

    node.rclpy.create_subscription(kind, source, hold_back, heard, raw=True)


robot = ros2_interface(load_profile(f"{profile}@near"))
client = ros2_interface(load_profile(f"{profile}@far"))
for part, kind in (("odometry", Odometry), ("color", Image), ("depth", Image)):
    pass_on(kind, getattr(robot, part), getattr(client, part), SENSOR_DATA, SENSOR_DATA)
own, shown = (lambda topic: robot.resolve(topic.lstrip("/"))), (lambda topic: client.resolve(topic.lstrip("/")))
# No node steers by the true pose, so every fifth message is enough to measure errors.
pass_on(Odometry, own(GROUND_TRUTH), shown(GROUND_TRUTH), SENSOR_DATA, SENSOR_DATA, one_in=5)
pass_on(String, own(ACCOUNT), shown(ACCOUNT), LATCHED, LATCHED)
pass_on(Twist, client.command, robot.command, SENSOR_DATA, RELIABLE)
answered = [PLACE, *(["/discrete_move"] if server == "vsnbench" else [])]
for service in answered:
    pass_on(String, f"{shown(service)}/question", f"{own(service)}/question", RELIABLE, RELIABLE)
    pass_on(String, f"{own(service)}/answer", f"{shown(service)}/answer", RELIABLE, RELIABLE)
sys.stdout.write("up\n")
sys.stdout.flush()
while True:
    with changed:
        now_s = time.monotonic()
        if not waiting or waiting[0][0] > now_s:
            changed.wait(waiting[0][0] - now_s if waiting else None)
            continue
        _, _, publisher, data = heapq.heappop(waiting)
    publisher.publish(data)
