"""Velocities to a base that listens to Twist or TwistStamped, and what others command on the same topic."""

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from vsnbench.errors import RobotError
from vsnbench.motion.controller import Command
from vsnbench.ros2.graph_check import command_fault, incompatibility, listeners
from vsnbench.ros2.interface import VELOCITIES, Ros2Interface

if TYPE_CHECKING:
    from vsnbench.ros2.graph import Graph
    from vsnbench.ros2.node import Ros2Node, VelocityPublisher

TakeTwist = Callable[[Any, str], None]
"""Called with a Twist that another node published, and that node's name."""


class Velocities:
    """Commands a base, once the graph has shown that one listens and how."""

    def __init__(self, node: "Ros2Node", graph: "Graph", names: Ros2Interface, take: TakeTwist | None = None) -> None:
        self._node = node
        self._graph = graph
        self._names = names
        self._take = take
        self._lock = threading.Lock()
        self._publisher: VelocityPublisher | None = None
        self._type = ""

    def send(self, command: Command) -> None:
        """Command a velocity; nothing happens while no base listens."""
        with self._lock:
            if self._publisher is not None:
                self._publisher.publish(command)

    def connect(self) -> RobotError | None:
        """Be ready to command the base; returns why no base would move, None when one would."""
        topic: str = self._names.command
        wanted: str = self._names.command_type
        subscribers = self._graph.subscribers(topic)
        if fault := command_fault(topic, wanted, subscribers, VELOCITIES):
            return fault
        bases = listeners(subscribers)
        if mismatch := incompatibility(self._node.velocity_quality, bases):
            return RobotError(f"{topic}: {mismatch.statement}", advice=mismatch.advice)
        kind = wanted or next(one.type_name for one in bases if one.type_name in VELOCITIES)
        if not self._open(kind).is_heard:
            return RobotError(f"{bases[0].node} listens on {topic} and is not connected yet")
        return None

    def _open(self, kind: str) -> "VelocityPublisher":
        with self._lock:
            if self._publisher is not None and kind == self._type:
                return self._publisher
            if self._publisher is not None:
                self._publisher.close()
            self._publisher = opened = self._node.velocity_publisher(self._names.command, kind)
            self._type = kind
        if self._take is not None:
            self._node.listen_to_velocities(self._names.command, kind, self._on_command)
        return opened

    def _on_command(self, read: Callable[[], Any], info: Any) -> None:
        sender = self._graph.sender(self._names.command, info)
        if sender != self._node.full_name and self._take is not None:
            self._take(read(), sender or "another node")
