"""Prints when a robot's odometry `moves` and since when it `stands`: `odometry_watch.py TOPIC`.

It is at rest once its pose has been constant for SETTLED_S, on the monotonic clock of this machine.
"""

import sys
import time

from vsnbench.ros.ros2.installation import require_ros2

require_ros2()
from nav_msgs.msg import Odometry

from vsnbench.ros.common.messages import planar
from vsnbench.ros.ros2.node import SENSOR_DATA, Ros2Node

SETTLED_S = 0.5


class Watch:
    def __init__(self) -> None:
        self.pose: tuple[float, ...] | None = None
        self.changed_s = 0.0
        self.moves = False

    def hear(self, message: Odometry) -> None:
        now_s, pose = time.monotonic(), planar(message)
        if self.pose is not None and max(abs(a - b) for a, b in zip(pose, self.pose, strict=True)) > 1e-4:
            self.changed_s = now_s
        self.pose = pose
        if (moves := now_s - self.changed_s < SETTLED_S) != self.moves:
            self.moves = moves
            sys.stdout.write(f"{'moves' if moves else 'stands'} {self.changed_s}\n")
            sys.stdout.flush()


Ros2Node("odometry_watch").rclpy.create_subscription(Odometry, sys.argv[1], Watch().hear, SENSOR_DATA)
while True:
    time.sleep(60)
