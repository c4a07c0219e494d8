"""The discrete_move node over ROS 2: executes one movement per request.

It stops when the client stops repeating its request (`topic_service.GONE_S`), and whenever it ends.
"""

import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from vsnbench.control.command import Command
from vsnbench.control.discrete_move_settings import motion_settings
from vsnbench.errors import RobotError
from vsnbench.ros.common.discrete_move import NODE, DiscreteMoveTask, mover_of
from vsnbench.ros.common.messages import result_to_json
from vsnbench.ros.ros2.graph import Graph
from vsnbench.ros.ros2.hazard_events import subscribe_hazards
from vsnbench.ros.ros2.interface import ros2_interface
from vsnbench.ros.ros2.node import LATCHED, Ros2Node
from vsnbench.ros.ros2.readiness import OTHER_VERSION
from vsnbench.ros.ros2.subscriptions import Ros2Odometry
from vsnbench.ros.ros2.topic_service import TopicServiceServer
from vsnbench.ros.ros2.velocities import Velocities
from vsnbench.sensing.simulation import ACCOUNT, read_account
from vsnbench.values.robot_profile import RobotProfile

__all__ = ["NODE", "Ros2DiscreteMove"]

logger = logging.getLogger(__name__)


class Ros2DiscreteMove(DiscreteMoveTask):
    """Executes movements for one robot until it is closed."""

    def __init__(self, node: Ros2Node, profile: RobotProfile, file: Path | None = None) -> None:
        names = ros2_interface(profile)
        self._node = node
        super().__init__(
            names, mover_of(profile, motion_settings(profile, file), self.send, node.now_s, node.sleep_until)
        )
        self._velocities = Velocities(node, Graph(node), names, self.take_foreign_command)
        self._odometry = Ros2Odometry(node, names, self.take_odometry)
        node.rclpy.create_subscription(String, names.simulation_topic(ACCOUNT), self._on_account, LATCHED)
        subscribe_hazards(node, names, self._mover.take_hazard)
        for part in names.hazard_topics:
            if part.missing_package:
                logger.warning("%s cannot be read: %s is not installed", part.topic, part.missing_package)
        publish_state = node.text_publisher(f"{names.paths}_state")
        node.subscribe_text(names.paths, lambda text: publish_state(self.take_path(text)))
        self._server = TopicServiceServer(node, names.discrete_move, self._answer)

    def send(self, command: Command) -> None:
        """Publish a velocity."""
        self._velocities.send(command)

    def _answer(self, request: Mapping[str, Any], caller_gone: Callable[[], bool]) -> Mapping[str, Any]:
        match request.get("request"):
            case "ping":
                return {"missing": self._missing()}
            case "reset":
                self._mover.forget_heading()
                return {}
            case "drive":
                fault = self._velocities.connect()
                content = request.get("movement")
                return result_to_json(
                    self.refuse("drive", str(fault)) if fault else self.drive_json(content, caller_gone)
                )
        return {"missing": OTHER_VERSION}  # the request has another form

    def _missing(self) -> str:
        """Return the part of the base that this node has not found yet, or an empty string."""
        if not self._odometry_arrived.is_set():
            return self._odometry.fault or "no odometry received yet"
        fault = self._velocities.connect()
        return fault.statement if fault else ""

    def _on_account(self, message: Any) -> None:
        try:
            account = read_account(message.data)
        except RobotError as error:
            logger.warning("%s", error)
            return
        self._node.follow_simulated_time(simulated=account.rate_factor != 1)
