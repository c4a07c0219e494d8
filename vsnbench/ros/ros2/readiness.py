"""Checks that every part of a robot on a ROS 2 graph answers."""

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.errors import RobotError
from vsnbench.ros.common.readiness import Readiness
from vsnbench.ros.ros2.docking import Dock
from vsnbench.ros.ros2.graph import Graph, type_fault
from vsnbench.ros.ros2.installation import discovery
from vsnbench.ros.ros2.interface import Ros2Interface
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.sensing.simulation import ACCOUNT
from vsnbench.values.encoding.motion_answer import MOST_TEXT, MotionCard, text_in

if TYPE_CHECKING:
    from vsnbench.ros.ros2.node import Ros2Node
    from vsnbench.ros.ros2.topic_service import TopicServiceClient

OTHER_VERSION = "it runs another version of vsnbench; run the same version on both machines"
"""What keeps a node of discrete_move from answering to requests of this version."""
_DISCOVERY_S = 3.5
"""Time in which all nodes are discovered: DDS repeats lost announcements after 3 s."""


def card_of_mover(mover: "TopicServiceClient", timeout_s: float) -> MotionCard | None:
    """Return the card of the motion adapter that serves discrete_move; None for a node of vsnbench.

    Raises:
        NoAnswerError: it does not answer in time.
        RobotError: it cannot move the base.
    """
    answer = mover.call({"request": "ping"}, timeout_s)
    card = None
    try:
        missing = text_in(answer, "missing", MOST_TEXT) if "missing" in answer else OTHER_VERSION
        if answer.get("adapter") is not None:
            card = MotionCard.of(answer["adapter"])
    except ValueError as error:
        missing = str(error)
    if missing:
        raise RobotError(f"{mover.name} cannot move the base: {missing}", code="discrete-move-not-ready")
    return card


@dataclass
class Ros2Readiness(Readiness):
    """Finds the first part of a robot that does not answer."""

    names: Ros2Interface
    node: "Ros2Node"
    """The client's node."""
    graph: Graph
    connect: Callable[[], RobotError | None]
    """Connects to the base; returns why no base would move, or None."""
    choose_server: Callable[[], RobotError | None]
    """Selects what executes movements; returns why nothing can, or None."""
    dock: Dock

    @property
    def _discovery_left_s(self) -> float:
        return max(0.0, self.node.began_s + _DISCOVERY_S - time.monotonic())

    def _network_fault(self) -> RobotError | None:
        names = self.names
        if earlier := self._earlier_session():
            return RobotError(
                f"{earlier} already uses this robot", advice="wait until it has ended", code="robot-in-use"
            )
        namespaced = self.profile.given_in("NAMESPACE")
        for topic in (names.odometry, names.color, names.depth):
            nodes = self._publishers(topic)
            if len(nodes) > 1:
                return RobotError(
                    f"{' and '.join(nodes)} both publish {topic}",
                    advice=f"end one of them, or set the robot's namespace (--robot {namespaced})",
                    code="two-publishers",
                )
        return self.connect()

    def _server_fault(self, now: RobotSnapshot) -> RobotError | None:
        if now.simulation is None and self.graph.publishers(self.names.simulation_topic(ACCOUNT)):
            return RobotError("the simulator has not described itself yet", code="no-simulation-account")
        if fault := self.dock.fault:
            return fault
        if now.simulation is None and self.dock.doubt:
            self._warn_once(self.dock.doubt)
        return self.choose_server()

    def _publishers(self, topic: str) -> list[str]:
        return sorted(publisher.node for publisher in self.graph.publishers(topic))

    def _types(self, topic: str) -> Collection[str]:
        return {publisher.type_name for publisher in self.graph.publishers(topic)}

    def _silence(self, what: str, topic: str, driver: str) -> RobotError:
        kind = self.names.odometry_type if what == "odometry" else "sensor_msgs/Image"
        if fault := type_fault(topic, self.names.type_name(kind), self.graph.publishers(topic)):
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
        place, _, own = self.node.full_name.rpartition("/vsnbench_")
        for name in self.graph.nodes():
            other_place, _, number = name.rpartition("/vsnbench_")
            if other_place == place and number.isdecimal() and int(number) < int(own):
                return name
        return ""
