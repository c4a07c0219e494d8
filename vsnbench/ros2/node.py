"""Be a ROS 2 node without the traps: a context of one's own, a thread that spins and is joined, no signals taken.

Shutting a context down under a spinning executor can abort the process: `close` stops and joins the thread first.
Imported only where ROS 2 is installed.
"""

import contextlib
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from typing import Any, ClassVar, Protocol

import rclpy
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from vsnbench.end_signals import EndAsked
from vsnbench.errors import RobotError
from vsnbench.motion.controller import Command
from vsnbench.ros2.installation import discovery
from vsnbench.ros2.messages import COMMAND_CLASSES, twist_of, velocity_message

SENSOR_DATA = QoSProfile(
    depth=10,
    history=QoSHistoryPolicy.KEEP_LAST,
    reliability=QoSReliabilityPolicy.BEST_EFFORT,
    durability=QoSDurabilityPolicy.VOLATILE,
)
"""What drivers publish sensors with, and what every publisher of sensors satisfies."""
RELIABLE = QoSProfile(depth=10, history=QoSHistoryPolicy.KEEP_LAST, reliability=QoSReliabilityPolicy.RELIABLE)
"""What commands and questions are sent with; satisfies a listener that asks for best effort, too."""
LATCHED = QoSProfile(
    depth=1,
    history=QoSHistoryPolicy.KEEP_LAST,
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.TRANSIENT_LOCAL,
)
"""What comes again to whoever listens later."""


class _NodeWithoutEvents(Node):  # type: ignore[misc]
    """A node whose publishers and subscribers leave it to `graph_check` to say what does not fit.

    rclpy would watch each of them for two events more, which makes every message of every topic cost twice as much.
    """

    def create_publisher(self, *words: Any, **more: Any) -> Any:
        return super().create_publisher(
            *words, **{"event_callbacks": PublisherEventCallbacks(use_default_callbacks=False), **more}
        )

    def create_subscription(self, *words: Any, **more: Any) -> Any:
        return super().create_subscription(
            *words, **{"event_callbacks": SubscriptionEventCallbacks(use_default_callbacks=False), **more}
        )


class Ros2Node:
    """A node that spins in a thread of its own until it is closed; callbacks come in that thread.

    Args:
        name: the node's name.
        namespace: its namespace.
        by_network_alone: never share memory with the other nodes on this machine, as Fast DDS does by default: a
            precaution, so that a node that is killed leaves no lock behind for a base's driver to wait for. For nodes
            that hear no images, whose size is what shared memory is good for. A transport that the environment names
            stays; where discovery is LOCALHOST only, ROS 2 chooses itself, and memory is shared.
    """

    velocity_quality: ClassVar[Any] = RELIABLE
    """The quality of service that velocities are sent with."""

    def __init__(self, name: str, namespace: str = "", *, by_network_alone: bool = False) -> None:
        if by_network_alone:
            os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
        # It would write a log file for every process; what matters goes through our own logging.
        os.environ.setdefault("ROS_LOG_DIR", tempfile.gettempdir())
        quiet = ["--ros-args", "--log-level", "error", "--disable-external-lib-logs", "--disable-rosout-logs"]
        self._context = rclpy.Context()
        try:
            rclpy.init(args=quiet, context=self._context, signal_handler_options=SignalHandlerOptions.NO)
            self.rclpy = _NodeWithoutEvents(
                name,
                context=self._context,
                namespace=namespace or None,
                enable_rosout=False,
                start_parameter_services=False,
            )
        except Exception as error:
            first = str(error).partition("\n")[0]
            raise RobotError(f"no ROS 2 node can be made here ({discovery()}): {first}") from error
        self.full_name = self.rclpy.get_fully_qualified_name()
        self.began_s = time.monotonic()
        self._ended = threading.Event()
        self._wake = self.rclpy.create_guard_condition(lambda: None)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.rclpy)
        self._thread = threading.Thread(target=self._spin, name=f"ros2 {name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the graph; may be called more than once."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._wake.trigger()
        self._thread.join(5.0)
        with contextlib.suppress(Exception):
            self._executor.remove_node(self.rclpy)
        self._executor.shutdown(timeout_sec=1.0)
        self.rclpy.destroy_node()
        self._context.try_shutdown()

    @property
    def simulated_time(self) -> bool:
        """Whether time is that of a simulator."""
        return bool(self.rclpy.get_clock().ros_time_is_active)

    def follow_simulated_time(self, *, simulated: bool) -> None:
        """Take the time from /clock, or no longer."""
        if simulated != self.simulated_time:
            self.rclpy.set_parameters([Parameter("use_sim_time", value=simulated)])

    def now_s(self) -> float:
        """Return the time that control runs on: monotonic, or simulated where a simulator is the clock."""
        if self.simulated_time:
            return float(self.rclpy.get_clock().now().nanoseconds) * 1e-9
        return time.monotonic()

    def sleep_until(self, due_s: float, give_up_wall_s: float = 1.0) -> None:
        """Sleep until `now_s()` reaches `due_s`; never longer than `give_up_wall_s` of real time."""
        give_up_s = time.monotonic() + give_up_wall_s
        while (left_s := due_s - self.now_s()) > 0 and time.monotonic() < give_up_s:
            time.sleep(0.001 if self.simulated_time else min(left_s, give_up_wall_s))

    def velocity_publisher(self, topic: str, kind: str) -> "VelocityPublisher":
        """Return what publishes velocities as messages of a type's name."""
        return VelocityPublisher(self, topic, kind)

    def listen_to_velocities(self, topic: str, kind: str, take: Callable[[Callable[[], Any], Any], None]) -> None:
        """Hand every velocity of a topic to `take`: what reads it as a Twist, and what is known of its sender."""
        message_class = COMMAND_CLASSES[kind]

        def hand_over(data: bytes, info: Any) -> None:
            take(lambda: twist_of(deserialize_message(data, message_class)), info)

        self.rclpy.create_subscription(message_class, topic, hand_over, SENSOR_DATA, raw=True)

    def text_publisher(self, topic: str) -> Callable[[str], None]:
        """Return what publishes a text as std_msgs/String, reliably."""
        publisher = self.rclpy.create_publisher(String, topic, RELIABLE)
        return lambda text: publisher.publish(String(data=text))

    def listen_to_texts(self, topic: str, take: Callable[[str], None]) -> None:
        """Hand every std_msgs/String of a topic to `take`."""
        self.rclpy.create_subscription(String, topic, lambda message: take(message.data), RELIABLE)

    def stamp(self) -> Any:
        """Return the present as messages carry it."""
        return self.rclpy.get_clock().now().to_msg()

    def _spin(self) -> None:
        while not self._ended.is_set():
            try:
                self._executor.spin_once()  # with a timeout, each message would cost a timer
            except ExternalShutdownException:
                return


class VelocityPublisher:
    """Publishes velocities on one topic, as messages of a type's name."""

    def __init__(self, node: Ros2Node, topic: str, kind: str) -> None:
        self._node = node
        self._kind = kind
        self._publisher = node.rclpy.create_publisher(COMMAND_CLASSES[kind], topic, node.velocity_quality)

    @property
    def is_heard(self) -> bool:
        """Whether anybody is connected who listens."""
        return bool(self._publisher.get_subscription_count())

    def publish(self, command: Command) -> None:
        """Send a velocity."""
        self._publisher.publish(velocity_message(command, self._kind, self._node.stamp()))

    def close(self) -> None:
        """Publish no more."""
        self._node.rclpy.destroy_publisher(self._publisher)


class Closable(Protocol):
    """A node's work: it runs in threads of its own until it is closed."""

    def close(self) -> None:
        """Stop, and leave the robot standing still."""
        ...


def run_node(
    name: str, namespace: str, make: Callable[[Ros2Node], Closable], what: str, *, by_network_alone: bool = False
) -> None:
    """Be a node until SIGINT, SIGTERM or SIGHUP.

    Args:
        name: the node's name.
        namespace: its namespace, that of the robot.
        make: what starts the node's work; may refuse.
        what: what the node does, in words, for the terminal.
        by_network_alone: see `Ros2Node`.

    Raises:
        RobotError: the work was refused.
    """
    ended = EndAsked().listen()
    node = Ros2Node(name, namespace, by_network_alone=by_network_alone)
    try:
        work = make(node)
        try:
            sys.stderr.write(f"{what} ({discovery()}); Ctrl-C ends it\n")
            ended.wait()
        finally:
            work.close()
            # The last command leaves through the middleware's own threads.
            time.sleep(0.1)
    finally:
        node.close()
