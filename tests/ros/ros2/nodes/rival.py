"""Another publisher of velocities: 0.2 m/s at 20 Hz on cmd_vel until it is ended; `--stamped` for TwistStamped."""

import sys
import time

from vsnbench.ros.ros2.installation import require_ros2

require_ros2()
from vsnbench.control.command import Command
from vsnbench.ros.ros2.interface import TWIST, TWIST_STAMPED
from vsnbench.ros.ros2.node import Ros2Node

node = Ros2Node("rival")
commands = node.velocity_publisher("/cmd_vel", TWIST_STAMPED if "--stamped" in sys.argv else TWIST)
while True:
    commands.publish(Command(0.2, 0.0))
    time.sleep(0.05)
