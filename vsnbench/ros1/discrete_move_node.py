"""The discrete_move node: upstream's service name, type and meaning, around `DiscreteMover`.

Imported only where ROS is installed.
"""

import json
import logging
import select
import socket
import threading
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rospy.impl.tcpros_service import Service
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from vsnbench.motion.controller import STANDSTILL, Command
from vsnbench.motion.discrete_move_settings import motion_settings
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.ros1.hazard_events import subscribe_hazard
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.messages import DiscreteServer, DiscreteServerResponse
from vsnbench.ros1.node import now_s, publish_while_open, sleep_until
from vsnbench.sensing.discrete_mover import DiscreteMover, Hazard, Outcome
from vsnbench.sensing.odometry import OdometryTracker, heading_of_quaternion

logger = logging.getLogger(__name__)

NODE = "discrete_move"


class _WatchfulService(Service):  # type: ignore[misc]  # ROS ships no types
    """A service whose handler can ask whether the caller is still connected; ROS handles each in a thread."""

    def __init__(self, name: str, service_class: Any, handler: Callable[[Any], Any]) -> None:
        self._calling = threading.local()
        super().__init__(name, service_class, handler)

    def caller_gone(self) -> bool:
        """Return whether the caller whom the present thread serves has closed the connection."""
        return _is_closed(self._calling.connection)

    def _handle_request(self, transport: Any, request: Any) -> None:
        self._calling.connection = transport.socket
        super()._handle_request(transport, request)


def _is_closed(connection: socket.socket) -> bool:
    """Return whether the other side closed the connection, as the system does for a killed process."""
    try:
        return bool(select.select([connection], [], [], 0)[0]) and not connection.recv(1, socket.MSG_PEEK)
    except (OSError, ValueError):
        return True


class DiscreteMoveNode:
    """Serves discrete_move for one robot until it is closed; the node must have been started."""

    def __init__(self, profile: RobotProfile, file: Path | None = None) -> None:
        names = ros1_interface(profile)
        self.settings: MotionSettings = motion_settings(profile, file, _private_parameters())
        self._commands = rospy.Publisher(names.command, Twist, queue_size=10, tcp_nodelay=True)
        self._outcomes = rospy.Publisher(f"{names.discrete_move}/outcome", String, queue_size=10)
        self._mover = DiscreteMover(
            self._send,
            self.settings,
            OdometryTracker(profile.base.max_linear_m_s, profile.base.max_angular_rad_s),
            now_s,
            sleep_until,
        )
        self._closed = threading.Event()
        rospy.Subscriber(names.odometry, Odometry, self._on_odometry, queue_size=10, tcp_nodelay=True)
        for hazard in Hazard:
            subscribe_hazard(names, hazard, self._mover.take_hazard)
        Service(f"{names.discrete_move}/reset", Trigger, self._on_reset)
        self._service = _WatchfulService(names.discrete_move, DiscreteServer, self._on_request)

    def close(self) -> None:
        """Stand still and answer False to whoever waits; may be called more than once."""
        if not self._closed.is_set():
            self._closed.set()
            self._mover.stop("discrete_move is shutting down")
            self._send(STANDSTILL)

    def _send(self, command: Command) -> None:
        twist = Twist()
        twist.linear.x = command.linear_m_s
        twist.angular.z = command.angular_rad_s
        publish_while_open(self._commands, twist)

    def _on_odometry(self, message: Any) -> None:
        pose = message.pose.pose
        heading_rad = heading_of_quaternion(
            pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w
        )
        self._mover.take_odometry(pose.position.x, pose.position.y, heading_rad, message.header.stamp.to_sec())

    def _on_request(self, request: Any) -> Any:
        if self._closed.is_set():
            return DiscreteServerResponse(False)
        outcome = self._mover.carry_out(request.movement, request.angle, self._service.caller_gone)
        self._report(outcome)
        return DiscreteServerResponse(outcome.answer)

    def _on_reset(self, _request: Any) -> Any:
        self._mover.forget_heading()
        return TriggerResponse(True, "the next movement starts from the present heading")

    def _report(self, outcome: Outcome) -> None:
        """Say on /rosout and on our own topic what the service's bool cannot carry."""
        publish_while_open(self._outcomes, String(json.dumps(asdict(outcome))))
        if outcome.answer:
            logger.info("%s: done in %.2f s", outcome.movement, outcome.duration_s)
        else:
            rospy.logwarn("%s: False: %s", outcome.movement, outcome.reason)


def _private_parameters() -> dict[str, Any]:
    found = rospy.get_param("~", {})
    return dict(found) if isinstance(found, dict) else {}
