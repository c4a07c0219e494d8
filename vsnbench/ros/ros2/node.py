"""A ROS 2 node with its own context and thread, which leaves signal handlers alone.

Shutting a context down under a spinning executor can abort the process, so `close` joins the thread first.
"""

import contextlib
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, ClassVar, Final

import rclpy
from rclpy.action import ActionClient
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from vsnbench.control.command import Command
from vsnbench.errors import RobotError
from vsnbench.ros.common.node import LAST_MESSAGES_S, NodeTask, sleep_until
from vsnbench.ros.ros2.installation import discovery, type_of
from vsnbench.ros.ros2.messages import COMMAND_CLASSES, twist_of, velocity_message
from vsnbench.runtime.signals import EndAsked

SENSOR_DATA = QoSProfile(
    depth=10, reliability=QoSReliabilityPolicy.BEST_EFFORT, durability=QoSDurabilityPolicy.VOLATILE
)
"""Quality of service of sensors, which every driver offers."""
RELIABLE = QoSProfile(depth=10, reliability=QoSReliabilityPolicy.RELIABLE)
"""Quality of service of commands and requests; also matches subscribers that require best effort."""
LATCHED = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.RELIABLE, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
"""Quality of service of messages that late subscribers receive again."""
_THREAD_S: Final = 10.0
"""Longest time until the thread of a node does what another thread asks for."""


class _NodeWithoutEvents(Node):  # type: ignore[misc]
    """A node without rclpy's default event callbacks, which double the cost of every message.

    `graph` reports the mismatches that those callbacks would log.
    """

    def create_publisher(self, *arguments: Any, **options: Any) -> Any:
        return super().create_publisher(
            *arguments, **{"event_callbacks": PublisherEventCallbacks(use_default_callbacks=False), **options}
        )

    def create_subscription(self, message_class: type, topic: str, *arguments: Any, **options: Any) -> Any:
        callbacks = SubscriptionEventCallbacks(use_default_callbacks=False)
        try:
            return super().create_subscription(
                message_class, topic, *arguments, **{"event_callbacks": callbacks, **options}
            )
        except RuntimeError as error:
            # A profile that names one topic for two parts; DDS allows one type of a topic per process.
            if "incompatible type" not in str(error):
                raise
            raise RobotError(
                f"{topic} is named for two parts: as {type_of(message_class)} and as another type",
                advice="correct the topics in the profile",
                code="topic-of-two-types",
            ) from error


class Ros2Node:
    """A node that spins in its own thread until it is closed; callbacks run in that thread.

    Args:
        name: name of the node.
        namespace: namespace of the node.
        by_network_alone: share no memory with other nodes, unless the environment sets a transport or discovery is
            LOCALHOST. With shared memory, the default of Fast DDS, a killed node may leave a lock for which the driver
            of the base waits. For nodes that receive no images.
    """

    velocity_quality: ClassVar[Any] = RELIABLE
    """Quality of service of velocities."""

    def __init__(self, name: str, namespace: str = "", *, by_network_alone: bool = False) -> None:
        if by_network_alone:
            os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
        # rclpy would write a log file for every process; vsnbench logs through Python.
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
            raise RobotError(f"cannot create a ROS 2 node ({discovery()}): {first}", code="no-ros2-node") from error
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
        """Whether a simulator publishes the time."""
        return bool(self.rclpy.get_clock().ros_time_is_active)

    def follow_simulated_time(self, *, simulated: bool) -> None:
        """Set whether the time comes from /clock."""
        if simulated != self.simulated_time:
            self.rclpy.set_parameters([Parameter("use_sim_time", value=simulated)])

    def now_s(self) -> float:
        """Return the time of control loops: monotonic, or simulated where a simulator publishes the time."""
        if self.simulated_time:
            return float(self.rclpy.get_clock().now().nanoseconds) * 1e-9
        return time.monotonic()

    def sleep_until(self, due_s: float) -> None:
        """Sleep until `now_s()` reaches `due_s`; see `ros.common.node.sleep_until`."""
        sleep_until(due_s, self.now_s, lambda: self.simulated_time)

    def velocity_publisher(self, topic: str, kind: str) -> "VelocityPublisher":
        """Return a publisher of velocities as messages of type `kind`."""
        return VelocityPublisher(self, topic, kind)

    def subscribe_velocities(self, topic: str, kind: str, take: Callable[[Callable[[], Any], Any], None]) -> None:
        """Pass every velocity of a topic to `take`: a function that reads the Twist, and the message info."""
        message_class = COMMAND_CLASSES[kind]

        def on_velocity(data: bytes, info: Any) -> None:
            take(lambda: twist_of(deserialize_message(data, message_class)), info)

        self.rclpy.create_subscription(message_class, topic, on_velocity, SENSOR_DATA, raw=True)

    def text_publisher(self, topic: str) -> Callable[[str], None]:
        """Return a function that publishes a text as std_msgs/String, reliably."""
        publisher = self.rclpy.create_publisher(String, topic, RELIABLE)
        return lambda text: publisher.publish(String(data=text))

    def subscribe_text(self, topic: str, take: Callable[[str], None]) -> None:
        """Pass every std_msgs/String of a topic to `take`."""
        self.rclpy.create_subscription(String, topic, lambda message: take(message.data), RELIABLE)

    def action_client(self, kind: type, action: str) -> Any:
        """Return a client of an action of type `kind`.

        It is made in the thread that spins, because rclpy's client joins its node before it is complete: an executor in
        another thread could fail on it, and the node would receive nothing more.

        Raises:
            RobotError: the thread does not answer.
        """
        made: Future[Any] = Future()

        def make() -> None:
            try:
                made.set_result(ActionClient(self.rclpy, kind, action))
            except Exception as error:  # raised to the caller, as it would end the thread
                made.set_exception(error)

        self._executor.create_task(make)
        try:
            return made.result(_THREAD_S)
        except TimeoutError as error:
            raise RobotError(
                f"the ROS 2 node {self.full_name} does not answer", advice="run the command again", code="no-ros2-node"
            ) from error

    def stamp(self) -> Any:
        """Return the current time as a stamp."""
        return self.rclpy.get_clock().now().to_msg()

    def _spin(self) -> None:
        while not self._ended.is_set():
            try:
                self._executor.spin_once()  # with a timeout, each message would cost a timer
            except ExternalShutdownException:
                return


class VelocityPublisher:
    """Publishes velocities on one topic as messages of type `kind`."""

    def __init__(self, node: Ros2Node, topic: str, kind: str) -> None:
        self._node = node
        self._kind = kind
        self._publisher = node.rclpy.create_publisher(COMMAND_CLASSES[kind], topic, node.velocity_quality)

    @property
    def is_connected(self) -> bool:
        """Whether a subscriber is connected."""
        return bool(self._publisher.get_subscription_count())

    def publish(self, command: Command) -> None:
        """Publish a velocity."""
        self._publisher.publish(velocity_message(command, self._kind, self._node.stamp()))

    def close(self) -> None:
        """Close the topic."""
        self._node.rclpy.destroy_publisher(self._publisher)


def run_node(
    name: str, namespace: str, make: Callable[[Ros2Node], NodeTask], what: str, *, by_network_alone: bool = False
) -> None:
    """Run a node until SIGINT, SIGTERM or SIGHUP.

    Args:
        name: name of the node.
        namespace: namespace of the robot.
        make: starts the task of the node.
        what: description of the task for the terminal.
        by_network_alone: see `Ros2Node`.

    Raises:
        RobotError: the task cannot start.
    """
    ended = EndAsked().listen()
    node = Ros2Node(name, namespace, by_network_alone=by_network_alone)
    try:
        task = make(node)
        try:
            sys.stderr.write(f"{what} ({discovery()}); Ctrl-C ends it\n")
            ended.wait()
        finally:
            task.close()
            time.sleep(LAST_MESSAGES_S)
    finally:
        node.close()
