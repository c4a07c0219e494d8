"""A motion adapter over ROS 2 (docs/motion-adapter.md): `python ros2_adapter.py twist:TwistBase`.

Another robot is another `Base` in place of `TwistBase`, or has its own `execute` (nav2_adapter.py).
"""

import json
import signal
import time

from by_velocity import PERIOD_S, Movement, robot_of_command_line

GONE_S, KEPT = 0.6, 64


class MovementService:
    """Executes each movement once. A client repeats its question ten times a second until it has the answer."""

    def __init__(self, robot, publish) -> None:
        self.robot, self.movement, self.publish = robot, Movement(robot), publish
        self.key, self.heard_s, self.answers = None, 0.0, {}

    def take(self, text: str) -> None:
        """Begin a new movement, which ends the running one, or answer a question again."""
        asked = json.loads(text)
        key, request = (asked["asker"], asked["number"]), asked["question"]
        if request["request"] != "drive":
            self.answers[key] = {"missing": self.robot.missing, "adapter": self.robot.card}
        elif key != self.key and key not in self.answers:
            self.movement.stop()
            self.step()  # answers the one that ran
            self.movement.begin(request)
            self.key = key
        if key == self.key:
            self.heard_s = time.monotonic()
        if key in self.answers:
            self.reply(key)

    def step(self) -> None:
        """Continue the running movement; called once in a period."""
        if self.movement.runs and time.monotonic() - self.heard_s > GONE_S:
            self.movement.stop()
        if self.movement.runs:
            self.movement.go_on(0.0)
        if self.key is not None and not self.movement.runs:
            self.answers[self.key] = self.movement.ended
            self.reply(self.key)
            self.key = None

    def reply(self, key: tuple[str, int]) -> None:
        """Publish an answer, and forget the oldest ones."""
        self.publish(json.dumps({"asker": key[0], "number": key[1], "answer": self.answers[key]}))
        for old in list(self.answers)[:-KEPT]:
            del self.answers[old]


def serve() -> None:
    """Run the robot of the command line as a node until Ctrl-C."""
    import rclpy
    from std_msgs.msg import String

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)  # Ctrl-C leaves time to stop the robot
    node = rclpy.create_node("motion_adapter")
    robot, answers = robot_of_command_line(node), node.create_publisher(String, "motion_adapter/answer", 10)
    service = MovementService(robot, lambda text: answers.publish(String(data=text)))
    node.create_subscription(String, "motion_adapter/question", lambda message: service.take(message.data), 10)
    print("serving motion_adapter")
    try:
        while True:
            due_s = time.monotonic() + PERIOD_S
            while (left_s := due_s - time.monotonic()) > 0:
                rclpy.spin_once(node, timeout_sec=left_s)
            service.step()
    except KeyboardInterrupt:
        robot.stop()
        time.sleep(0.1)  # for the last message
        rclpy.shutdown()


if __name__ == "__main__":
    serve()
