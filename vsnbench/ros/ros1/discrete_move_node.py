"""The discrete_move node over ROS 1, with the service name, type and meaning of upstream."""

import json
import select
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from rospy.impl.tcpros_service import Service
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from vsnbench.control.command import Command
from vsnbench.control.discrete_move_settings import motion_settings
from vsnbench.control.settings import MotionSettings
from vsnbench.ros.common.discrete_move import NODE, DiscreteMoveTask, mover_of
from vsnbench.ros.common.messages import result_to_json
from vsnbench.ros.ros1.hazard_events import subscribe_hazards, subscribe_states
from vsnbench.ros.ros1.interface import ros1_interface
from vsnbench.ros.ros1.messages import DiscreteServer, DiscreteServerResponse, twist_message
from vsnbench.ros.ros1.node import now_s, publish_while_open, sleep_until
from vsnbench.ros.ros1.service_words import movement_named
from vsnbench.ros.ros1.subscriptions import Ros1Odometry, sender_of
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.robot_profile import RobotProfile

__all__ = ["NODE", "Ros1DiscreteMove"]

_FIRST_ODOMETRY_S = 2.0
"""Longest wait for odometry before the services are advertised."""


class _CallerAwareService(Service):  # type: ignore[misc]  # ROS ships no types
    """A service whose handler can check that its caller is connected; rospy runs each call in a thread."""

    def __init__(self, name: str, service_class: Any, handler: Callable[[Any], Any]) -> None:
        self._calling = threading.local()
        super().__init__(name, service_class, handler)

    def caller_gone(self) -> bool:
        """Return whether the caller of the current thread has closed its connection."""
        return _is_closed(self._calling.connection)

    def _handle_request(self, transport: Any, request: Any) -> None:
        self._calling.connection = transport.socket
        super()._handle_request(transport, request)


def _is_closed(connection: socket.socket) -> bool:
    """Return whether the other side closed the connection; the system closes it for a killed process."""
    try:
        return bool(select.select([connection], [], [], 0)[0]) and not connection.recv(1, socket.MSG_PEEK)
    except (OSError, ValueError):
        return True


class Ros1DiscreteMove(DiscreteMoveTask):
    """Serves discrete_move for one robot until it is closed; the node must have been started."""

    def __init__(self, profile: RobotProfile, file: Path | None = None) -> None:
        names = ros1_interface(profile)
        self.settings: MotionSettings = motion_settings(profile, file, _private_parameters())
        self._commands = rospy.Publisher(names.command, Twist, queue_size=10, tcp_nodelay=True)
        self._outcomes = rospy.Publisher(f"{names.discrete_move}/outcome", String, queue_size=10)
        super().__init__(names, mover_of(profile, self.settings, self.send, now_s, sleep_until))
        Ros1Odometry(names, self.take_odometry, queue_size=10)
        rospy.Subscriber(names.command, Twist, self._on_command, queue_size=20, tcp_nodelay=True)
        subscribe_hazards(names.hazard_topics, self._mover.take_hazard)
        subscribe_states(names, self._mover.take_hazard)
        self._states = rospy.Publisher(f"{names.paths}_state", String, queue_size=5, tcp_nodelay=True)
        rospy.Subscriber(names.paths, String, self._on_path, queue_size=5, tcp_nodelay=True)
        # A client may call as soon as the service exists, and needs odometry then.
        self._odometry_arrived.wait(_FIRST_ODOMETRY_S)
        Service(f"{names.discrete_move}/reset", Trigger, self._on_reset)
        # The same type as discrete_move: its text carries the JSON of a movement.
        self._drive = _CallerAwareService(f"{names.discrete_move}/drive", DiscreteServer, self._on_drive)
        self._service = _CallerAwareService(names.discrete_move, DiscreteServer, self._on_request)

    def send(self, command: Command) -> None:
        """Publish a velocity."""
        publish_while_open(self._commands, twist_message(command))

    def _warn(self, text: str) -> None:
        rospy.logwarn(text)

    def _on_command(self, message: Any) -> None:
        node = sender_of(message)
        if node != rospy.get_name():
            self.take_foreign_command(message, node)

    def _on_path(self, message: Any) -> None:
        publish_while_open(self._states, String(self.take_path(message.data)))

    def _on_request(self, request: Any) -> Any:
        try:
            movement = movement_named(request.movement, request.angle, self.settings.forward_m)
        except ValueError as error:
            return self._answer(self.refuse(request.movement, str(error)))
        return self._answer(self.drive(movement, self._service.caller_gone))

    def _on_drive(self, request: Any) -> Any:
        try:
            content = json.loads(request.movement)
        except (ValueError, RecursionError):
            content = None
        return self._answer(self.drive_json(content, self._drive.caller_gone))

    def _answer(self, result: MotionResult) -> Any:
        # The bool of the service has no room for the reason.
        publish_while_open(self._outcomes, String(json.dumps(result_to_json(result))))
        return DiscreteServerResponse(result.completed)

    def _on_reset(self, _request: Any) -> Any:
        self._mover.forget_heading()
        return TriggerResponse(True, "the next movement starts from the present heading")


def _private_parameters() -> dict[str, Any]:
    found = rospy.get_param("~", {})
    return dict(found) if isinstance(found, dict) else {}
