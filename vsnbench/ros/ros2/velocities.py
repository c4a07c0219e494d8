"""Velocity commands to a base, and detection of velocities that other nodes send."""

import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from vsnbench.control.command import Command
from vsnbench.errors import RobotError
from vsnbench.ros.common.messages import command_of
from vsnbench.ros.ros2.graph import Graph, bases_of, command_fault, incompatibility
from vsnbench.ros.ros2.interface import VELOCITIES, Ros2Interface

if TYPE_CHECKING:
    from vsnbench.ros.ros2.node import Ros2Node, VelocityPublisher

_REMEMBERED = 200
TakeTwist = Callable[[Any, str], None]
"""Takes a Twist of another node and the name of that node, or an empty string while it is unknown."""


class Velocities:
    """Commands a base once the graph shows that the base subscribes, and in which type."""

    def __init__(self, node: "Ros2Node", graph: Graph, names: Ros2Interface, take: TakeTwist) -> None:
        self._node = node
        self._graph = graph
        self._names = names
        self._take = take
        self._lock = threading.Lock()
        self._sent: deque[Command] = deque(maxlen=_REMEMBERED)
        """Latest velocities of this process, to recognize them on the topic."""
        self._publisher: VelocityPublisher | None = None
        self._type = ""

    def send(self, command: Command) -> None:
        """Publish a velocity; does nothing before `connect`, and for a robot without velocities."""
        with self._lock:
            if self._publisher is not None:
                self._sent.append(command)
                self._publisher.publish(command)

    def connect(self) -> RobotError | None:
        """Connect to the base; returns why no base would move, or None."""
        topic = self._names.command
        if not topic:
            return None  # a motion adapter moves the robot
        wanted: str = self._names.command_type
        subscribers = self._graph.subscribers(topic)
        if fault := command_fault(topic, wanted, subscribers, VELOCITIES):
            return fault
        bases = bases_of(subscribers)
        if mismatch := incompatibility(self._node.velocity_quality, bases):
            return RobotError(f"{topic}: {mismatch.statement}", advice=mismatch.advice, code=mismatch.code)
        kind = wanted or next(base.type_name for base in bases if base.type_name in VELOCITIES)
        if not self._open(kind).is_connected:
            return RobotError(
                f"{bases[0].node} subscribes to {topic} but is not connected yet", code="base-not-connected"
            )
        return None

    def _open(self, kind: str) -> "VelocityPublisher":
        with self._lock:
            if self._publisher is not None and kind == self._type:
                return self._publisher
            if self._publisher is not None:
                self._publisher.close()
            self._publisher = opened = self._node.velocity_publisher(self._names.command, kind)
            self._type = kind
        self._node.subscribe_velocities(self._names.command, kind, self._on_command)
        return opened

    def _on_command(self, read: Callable[[], Any], info: Any) -> None:
        sender = self._graph.sender(self._names.command, info)
        if sender == self._node.full_name:
            return
        twist = read()
        # The sender is not conclusive before the graph knows this process's publisher, and after it was opened again.
        unsure = sender.partition(" (no. ")[0] in ("", self._node.full_name)
        if not (unsure and command_of(twist) in tuple(self._sent)):
            self._take(twist, sender)
