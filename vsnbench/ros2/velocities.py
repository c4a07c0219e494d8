"""Velocities to a base that listens to Twist or TwistStamped, and what others command on the same topic.

Imported only where ROS 2 is installed.
"""

import threading
from collections.abc import Callable
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.motion.controller import Command
from vsnbench.ros2.graph import Graph
from vsnbench.ros2.graph_check import command_fault, incompatibility, listeners
from vsnbench.ros2.interface import Ros2Interface
from vsnbench.ros2.messages import COMMAND_CLASSES, twist_of, velocity_message
from vsnbench.ros2.node import RELIABLE, SENSOR_DATA, Ros2Node

TakeTwist = Callable[[Any, str], None]
"""Called with a Twist that another node published, and that node's name."""


class Velocities:
    """Commands a base, once the graph has shown that one listens and how."""

    def __init__(self, node: Ros2Node, graph: Graph, names: Ros2Interface, take: TakeTwist | None = None) -> None:
        self._node = node
        self._graph = graph
        self._names = names
        self._take = take
        self._lock = threading.Lock()
        self._publisher: Any = None
        self._type = ""

    def send(self, command: Command) -> None:
        """Command a velocity; nothing happens while no base listens."""
        with self._lock:
            if self._publisher is not None:
                self._publisher.publish(velocity_message(command, self._type, self._node.stamp()))

    def connect(self) -> RobotError | None:
        """Be ready to command the base; returns why no base would move, None when one would."""
        topic: str = self._names.command
        wanted: str = self._names.command_type
        subscribers = self._graph.subscribers(topic)
        if fault := command_fault(topic, wanted, subscribers, list(COMMAND_CLASSES)):
            return fault
        bases = listeners(subscribers)
        if mismatch := incompatibility(RELIABLE, bases):
            return RobotError(f"{topic}: {mismatch.statement}", advice=mismatch.advice)
        kind = wanted or next(one.type_name for one in bases if one.type_name in COMMAND_CLASSES)
        if kind != self._type:
            self._open(kind)
        if not self._publisher.get_subscription_count():
            return RobotError(f"{bases[0].node} listens on {topic} and is not connected yet")
        return None

    def _open(self, kind: str) -> None:
        topic, message_class = self._names.command, COMMAND_CLASSES[kind]
        with self._lock:
            if self._publisher is not None:
                self._node.rclpy.destroy_publisher(self._publisher)
            self._publisher = self._node.rclpy.create_publisher(message_class, topic, RELIABLE)
            self._type = kind
        if self._take is not None:
            self._node.rclpy.create_subscription(message_class, topic, self._on_command, SENSOR_DATA)

    def _on_command(self, message: Any, info: Any) -> None:
        sender = self._graph.sender(self._names.command, info)
        if sender != self._node.full_name and self._take is not None:
            self._take(twist_of(message), sender or "another node")
