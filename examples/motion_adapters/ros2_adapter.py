"""A motion adapter over ROS 2 (docs/motion-adapter.md): movements are questions on a topic, images and odometry topics.

    python ros2_adapter.py                       # a base that takes Twist on /cmd_vel and reports /odom
    vsnbench doctor --robot my-robot.yaml --move   # with `command: ""` and `discrete_move: motion_adapter`

Another robot is another `Base` in place of `TwistBase`, or another `execute` (nav2_adapter.py).
"""

import json
import math
import signal
import threading
import time
from collections.abc import Callable

from by_velocity import PERIOD_S, Base, execute

GONE_S, KEPT = 0.6, 64
STOPPED = {"completed": False, "refusal": "stopped", "failure": "the client is gone, or asked for another movement"}


class MovementService:
    """Answers each question once. The client repeats its question ten times a second: silence means that it is gone."""

    def __init__(self, publish: Callable[[str], None], answer: Callable[[dict, Callable[[], bool]], dict]) -> None:
        self._publish, self._answer = publish, answer
        self._heard_s: dict[tuple[str, int], float] = {}
        self._answers: dict[tuple[str, int], str] = {}
        self._latest: tuple[str, int] | None = None

    def on_question(self, text: str) -> None:
        """Take a question; answer one that was answered before again."""
        message = json.loads(text)
        key, request = (message["asker"], message["number"]), message["question"]
        is_new, self._heard_s[key] = key not in self._heard_s, time.monotonic()
        if key in self._answers:
            self._publish(self._answers[key])
        elif is_new:
            if request["request"] == "drive":
                self._latest = key  # ends the movement that runs
            threading.Thread(target=self._work, args=(key, request), daemon=True).start()

    def _work(self, key: tuple[str, int], request: dict) -> None:
        def gone() -> bool:
            return time.monotonic() - self._heard_s[key] > GONE_S or self._latest != key

        answer = self._answer(request, gone)
        self._answers[key] = json.dumps({"asker": key[0], "number": key[1], "answer": answer})
        self._publish(self._answers[key])
        for old in list(self._answers)[:-KEPT]:
            del self._answers[old], self._heard_s[old]


def answer_with(base: Base, moving: threading.Lock, request: dict, gone: Callable[[], bool]) -> dict:
    """Answer a question with a base that takes velocities."""
    if request["request"] != "drive":
        return {"missing": "" if base.pose else "no odometry received yet", "adapter": base.card}
    with moving:
        steps = execute(base, request["movement"], request.get("deadline_s", 60.0))
        try:
            while not gone():
                next(steps)
        except StopIteration as end:
            return end.value
        finally:
            base.stop()
    return STOPPED


class TwistBase(Base):
    """A base on /cmd_vel and /odom."""

    card = {"name": "twist-base", "version": "1", "movements": ["move", "waypoint", "trajectory", "velocity"]}  # noqa: RUF012

    def __init__(self, node) -> None:
        from geometry_msgs.msg import Twist
        from nav_msgs.msg import Odometry
        from rclpy.qos import qos_profile_sensor_data

        self._twist, self._pose, self._heard_s = Twist, None, 0.0
        self._publisher = node.create_publisher(Twist, "cmd_vel", 10)
        node.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)

    def _on_odometry(self, message) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
        self._pose, self._heard_s = (at.x, at.y, heading), time.monotonic()

    @property
    def now_s(self) -> float:
        return time.monotonic()

    @property
    def pose(self) -> tuple[float, float, float]:
        return self._pose

    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        twist = self._twist()
        twist.linear.x, twist.angular.z = forward_m_s, turn_rad_s
        self._publisher.publish(twist)
        time.sleep(PERIOD_S)
        return "sensor" if time.monotonic() - self._heard_s > 1.0 else ""

    def stop(self) -> None:
        self._publisher.publish(self._twist())

    def state(self, *, with_depth: bool = False) -> dict:
        return {"pose": list(self._pose), "stamp_s": self.now_s}

    def colours(self) -> dict:
        raise NotImplementedError("images are topics")


def serve(name: str, make: Callable) -> None:
    """Run the node until Ctrl-C; `make(node)` returns the function that answers questions, and one that stops."""
    import rclpy
    from rclpy.node import Node
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import String

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # Ctrl-C must leave time to stop the robot
    node = Node(name)
    answers = node.create_publisher(String, f"{name}/answer", 10)
    answer, stop = make(node)
    service = MovementService(lambda text: answers.publish(String(data=text)), answer)
    node.create_subscription(String, f"{name}/question", lambda message: service.on_question(message.data), 10)
    print(f"serving {name}")
    try:
        while True:
            rclpy.spin_once(node, timeout_sec=0.1)
    except KeyboardInterrupt:
        print("stopped")
    finally:
        stop()
        time.sleep(0.1)  # for the last message
        rclpy.shutdown()


def with_twist(node) -> tuple[Callable, Callable]:
    """Return what answers questions with a base that takes Twist, and what stops it."""
    base, moving = TwistBase(node), threading.Lock()
    return lambda request, gone: answer_with(base, moving, request, gone), base.stop


if __name__ == "__main__":
    serve("motion_adapter", with_twist)
