"""Checks that every part of a robot on a ROS 2 graph answers."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.errors import RobotError
from vsnbench.ros2.docking import Dock
from vsnbench.ros2.graph import Graph, type_fault
from vsnbench.ros2.installation import discovery
from vsnbench.ros2.interface import Ros2Interface
from vsnbench.ros_common import readiness
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.sensing.simulation import ACCOUNT

if TYPE_CHECKING:
    from vsnbench.ros2.node import Ros2Node

_DISCOVERY_S = 3.5
"""Time in which all nodes are discovered: DDS repeats lost announcements after 3 s."""


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of a connection that are checked.

    Attributes:
        profile_name: name of the robot's profile.
        node: the client's node.
        graph: discovered nodes.
        connect: connects to the base; returns why none would move, or None.
        choose_server: selects what executes movements; returns why nothing can, or None.
        odometry_fault: returns why TF gives no odometry, or an empty string.
        dock: state of the charging dock.
        unsupported_topics: topics whose message type is not installed.
    """

    profile_name: str
    node: "Ros2Node"
    graph: Graph
    connect: Callable[[], RobotError | None]
    choose_server: Callable[[], RobotError | None]
    odometry_fault: Callable[[], str]
    dock: Dock
    unsupported_topics: Sequence[str]


class Readiness(readiness.Readiness):
    """Finds the first part of a robot that does not answer."""

    names: Ros2Interface

    def __init__(self, names: Ros2Interface, snapshot: Callable[[], RobotSnapshot], parts: Parts) -> None:
        super().__init__(names, snapshot, parts.odometry_fault)
        self._parts = parts

    @property
    def _discovery_left_s(self) -> float:
        return max(0.0, self._parts.node.began_s + _DISCOVERY_S - time.monotonic())

    def _network_fault(self) -> RobotError | None:
        names, parts = self.names, self._parts
        if earlier := self._earlier_session():
            return RobotError(
                f"{earlier} already uses this robot", advice="wait until it has ended", code="robot-in-use"
            )
        for topic in (names.odometry, names.color, names.depth):
            nodes = self._publishers(topic)
            if len(nodes) > 1:
                return RobotError(
                    f"{' and '.join(nodes)} both publish {topic}",
                    advice=f"end one of them, or set the robot's namespace (--robot {parts.profile_name}@NAMESPACE)",
                    code="two-publishers",
                )
        return parts.connect()

    def _server_fault(self, now: RobotSnapshot) -> RobotError | None:
        parts = self._parts
        if now.simulation is None and parts.graph.publishers(self.names.simulation_topic(ACCOUNT)):
            return RobotError("the simulator has not described itself yet", code="no-simulation-account")
        if fault := parts.dock.fault:
            return fault
        if now.simulation is None:
            if parts.dock.doubt:
                self._warn_once(parts.dock.doubt)
            for topic in parts.unsupported_topics:
                self._warn_once(
                    f"{topic} needs irobot_create_msgs, which is not installed: report collisions by the space bar, "
                    "and when asked after the episode"
                )
        return parts.choose_server()

    def _publishers(self, topic: str) -> list[str]:
        return sorted(publisher.node for publisher in self._parts.graph.publishers(topic))

    def _silence(self, what: str, topic: str, driver: str) -> RobotError:
        kind = self.names.odometry_type if what == "odometry" else "sensor_msgs/msg/Image"
        if fault := type_fault(topic, kind, self._parts.graph.publishers(topic)):
            return fault
        if nodes := " and ".join(sorted(set(self._publishers(topic)))):
            statement = f"no {what} on {topic}, which {nodes} publishes"
            advice = f"check that {nodes} is alive and the network fast enough"
        else:
            statement = f"no {what} on {topic}"
            advice = f"start {driver}; if it runs, check that it is in {discovery()} and in this namespace"
        return RobotError(statement, advice=advice, code="silent-topic")

    def _earlier_session(self) -> str:
        """Return the client that connected to this robot before this one, or an empty string."""
        place, _, own = self._parts.node.full_name.rpartition("/vsnbench_")
        for name in self._parts.graph.nodes():
            other_place, _, number = name.rpartition("/vsnbench_")
            if other_place == place and number.isdigit() and int(number) < int(own):
                return name
        return ""
