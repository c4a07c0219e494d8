"""A base that serves the action `undock`: `dock.py WHAT`, which is `leaves`, `stays`, `refuses` or `hangs`.

With `hangs` it prints `asked` when it receives the goal, and `cancelled` when the goal is cancelled.
"""

import sys
import threading
import time
from typing import Any

from vsnbench.ros.ros2.installation import require_ros2

require_ros2()
from irobot_create_msgs.action import Undock
from rclpy.action import ActionServer, CancelResponse, GoalResponse

from vsnbench.ros.ros2.node import Ros2Node

what = sys.argv[1]


def say(word: str) -> None:
    sys.stdout.write(f"{word}\n")
    sys.stdout.flush()


def begin(goal: Any) -> None:
    if what != "hangs":
        goal.execute()
        return

    def hang() -> None:
        say("asked")
        while not goal.is_cancel_requested:
            time.sleep(0.02)
        goal.execute()

    threading.Thread(target=hang, daemon=True).start()


def leave(goal: Any) -> Any:
    if what == "hangs":
        goal.canceled()
        say("cancelled")
        return Undock.Result()
    goal.succeed() if what == "leaves" else goal.abort()
    return Undock.Result(sequence=[] if what == "leaves" else [1])


ActionServer(
    Ros2Node("motion_control").rclpy,
    Undock,
    "undock",
    leave,
    goal_callback=lambda _: GoalResponse.REJECT if what == "refuses" else GoalResponse.ACCEPT,
    handle_accepted_callback=begin,
    cancel_callback=lambda _: CancelResponse.ACCEPT,
)
say("up")
while True:
    time.sleep(60)
