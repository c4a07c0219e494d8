"""The discrete_move node beside the base: one movement a question, around `DiscreteMover`.

It stands still when whoever asked falls silent (`questions.GONE_S`), and on every way out.
Imported only where ROS 2 is installed.
"""

import logging
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from std_msgs.msg import String

from vsnbench.errors import RobotError
from vsnbench.motion.controller import STANDSTILL
from vsnbench.motion.discrete_move_settings import motion_settings
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros2.graph import Graph
from vsnbench.ros2.hazard_events import subscribe_hazards
from vsnbench.ros2.interface import ros2_interface
from vsnbench.ros2.messages import planar, seconds
from vsnbench.ros2.node import LATCHED, SENSOR_DATA, Ros2Node
from vsnbench.ros2.questions import Answerer
from vsnbench.ros2.velocities import Velocities
from vsnbench.sensing.discrete_mover import DiscreteMover, Outcome
from vsnbench.sensing.odometry import OdometryTracker
from vsnbench.sensing.simulation import ACCOUNT, read_account

logger = logging.getLogger(__name__)

NODE = "discrete_move"


class DiscreteMoveNode:
    """Carries out movements for one robot until it is closed."""

    def __init__(self, node: Ros2Node, profile: RobotProfile, file: Path | None = None) -> None:
        names = ros2_interface(profile)
        self._node = node
        self._velocities = Velocities(node, Graph(node), names)
        self._mover = DiscreteMover(
            self._velocities.send,
            motion_settings(profile, file),
            OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s),
            node.now_s,
            node.sleep_until,
        )
        self._closed = threading.Event()
        self._odometry_heard = False
        listen = node.rclpy.create_subscription
        listen(Odometry, names.odometry, self._on_odometry, SENSOR_DATA)
        listen(String, names.resolve(ACCOUNT.lstrip("/")), self._on_account, LATCHED)
        for topic in subscribe_hazards(node, names, self._mover.take_hazard):
            logger.warning("%s cannot be heard without irobot_create_msgs", topic)
        self._answerer = Answerer(node, names.discrete_move, self._answer)

    def close(self) -> None:
        """Stand still and answer False to whoever waits; may be called more than once."""
        if not self._closed.is_set():
            self._closed.set()
            self._mover.stop("discrete_move is shutting down")
            self._velocities.send(STANDSTILL)

    def _answer(self, question: Mapping[str, Any], asker_gone: Callable[[], bool]) -> Mapping[str, Any]:
        movement = str(question.get("movement", ""))[:40]
        if movement == "Ping":
            return {"missing": self._missing()}
        if movement == "Reset":
            self._mover.forget_heading()
            return {}
        outcome = self._carry_out(movement, question, asker_gone)
        if outcome.answer:
            logger.info("%s: done in %.2f s", outcome.movement, outcome.duration_s)
        else:
            logger.warning("%s: False: %s", outcome.movement, outcome.reason)
        return asdict(outcome)

    def _missing(self) -> str:
        """Return what of the base this node has not found yet; empty for nothing."""
        if not self._odometry_heard:
            return "it has heard no odometry yet"
        fault = self._velocities.connect()
        return fault.statement if fault else ""

    def _carry_out(self, movement: str, question: Mapping[str, Any], asker_gone: Callable[[], bool]) -> Outcome:
        if self._closed.is_set():
            return Outcome(movement, False, "discrete_move is shutting down")
        if fault := self._velocities.connect():
            return Outcome(movement, False, str(fault))
        try:
            angle_deg, distance_m = int(question.get("angle_deg", 0)), float(question.get("distance_m", 0.25))
        except (TypeError, ValueError):
            return Outcome(movement, False, "the angle and the distance of a movement are numbers")
        return self._mover.carry_out(movement, angle_deg, asker_gone, distance_m)

    def _on_odometry(self, message: Any) -> None:
        self._mover.take_odometry(*planar(message), seconds(message.header.stamp))
        self._odometry_heard = True

    def _on_account(self, message: Any) -> None:
        try:
            account = read_account(message.data)
        except RobotError as error:
            logger.warning("%s", error)
            return
        self._node.follow_simulated_time(simulated=account.rate_factor != 1)
