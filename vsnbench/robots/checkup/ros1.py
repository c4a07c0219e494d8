"""The check-up of a robot over ROS 1."""

from __future__ import annotations

import math
import os
import socket
import time
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from urllib.parse import urlparse

from vsnbench.control.command import STANDSTILL, Command
from vsnbench.errors import RobotError
from vsnbench.robots.checkup.base import DOCTOR, RosCheckup, TurnTest, expected_topics
from vsnbench.robots.checkup.checks import battery_result
from vsnbench.robots.checkup.commanded_turn import turn_timeout_s
from vsnbench.robots.checkup.images import image_topics, image_type, type_advice
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.ros.common.messages import planar
from vsnbench.ros.ros1.graph import graph_faults, server_of
from vsnbench.ros.ros1.installation import missing_packages
from vsnbench.ros.ros1.interface import KOBUKI_STATE, Ros1Interface, ros1_interface
from vsnbench.ros.ros1.master import Master, MasterError, SystemState
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Move
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

if TYPE_CHECKING:
    from vsnbench.ros.ros1.service_call import ServiceClient
    from vsnbench.ros.ros1.subscriptions import Ros1Listener

_IMAGES_S = 0.5
"""Time for images before and after a turn."""
_LATEST = 10
"""Number of readings that arrive at most between two commands."""
_CONNECTING_S, _POLL_S = 3.0, 0.05
_NODE = f"/{DOCTOR}"
_OWN_NODES = frozenset({"/vsnbench", _NODE})
_TWIST = "geometry_msgs/Twist"


class Ros1Checkup(RosCheckup, TurnTest):
    """Checks every part of a robot over ROS 1."""

    names: Ros1Interface
    listener: Ros1Listener

    def __init__(self, profile: RobotProfile) -> None:
        super().__init__(profile)
        self.names = names = ros1_interface(profile)
        self.topics = expected_topics(names, {names.battery: names.battery_type})
        self._state = SystemState({}, {}, {})
        self._types: dict[str, str] = {}

    def _connect(self) -> Generator[CheckResult, None, bool]:
        if missing := missing_packages():
            yield CheckResult("ROS 1", Health.FAILED, f"no Python module {missing[0]}", "run scripts/install_ros.sh")
            return False
        yield CheckResult("ROS 1", Health.OK, "installed")
        try:
            self._master = master = Master.from_environment()
            began_s = time.monotonic()
            master.pid()
            trip_ms = (time.monotonic() - began_s) * 1000
        except MasterError as error:
            yield CheckResult("master", Health.FAILED, error.statement, error.advice)
            return False
        yield CheckResult("master", Health.OK, f"{master.uri} answers in {trip_ms:.0f} ms")
        yield _own_address(master)
        if (other := master.live_node("/vsnbench")) is not None:
            yield CheckResult("session", Health.WARNING, f"vsnbench is running at {other}", "wait until it has ended")
        self._receive()
        return True

    def _receive(self) -> None:
        from vsnbench.ros.ros1.hazard_events import KobukiStates, subscribe_hazards
        from vsnbench.ros.ros1.subscriptions import Ros1Listener

        names = self.names
        self.listener = Ros1Listener(DOCTOR, self.raw_topics)
        self.closing.callback(self.listener.close)
        self._ask_master()
        # rospy prints a traceback for a subscription to a topic of another type.
        readable = [part for part in names.hazard_topics if not self._types_of(part.topic) - {part.kind}]
        subscribe_hazards(readable, self.hazards.take)
        self.listen(self.listener)
        self._ask_master()
        if names.battery and self._has_type(names.battery, KOBUKI_STATE) and self.messages[names.battery].messages:
            KobukiStates(self.hazards.take)(self._read(KOBUKI_STATE, self.messages[names.battery].messages[-1]))

    def _ask_master(self) -> None:
        self._state, self._types = self._master.state(), self._master.topic_types()

    def _command_results(self) -> Iterator[CheckResult]:
        names, state, types = self.names, self._state, self._types
        subscribers = [node for node in state.subscribers.get(names.command, []) if node != _NODE]
        if not set(subscribers) - {server_of(names.discrete_move, state), "/vsnbench"}:
            advice = "start the driver of the base, or remap its topic"
            yield CheckResult(names.command, Health.FAILED, "no base subscribes", advice)
        elif types.get(names.command, _TWIST) != _TWIST:
            yield CheckResult(names.command, Health.FAILED, f"is a {types[names.command]}", f"it must be a {_TWIST}")
        else:
            yield CheckResult(names.command, Health.OK, f"subscribed by {', '.join(subscribers)}")
        for fault in graph_faults(names, state, types, _OWN_NODES):
            yield CheckResult(fault.name, Health.FAILED if fault.fatal else Health.WARNING, fault.seen, fault.advice)

    def _base_results(self, readable: dict[str, TopicMessages]) -> Iterator[CheckResult]:
        from vsnbench.ros.ros1.messages import battery_in

        names = self.names
        if names.battery and readable[names.battery].messages:
            battery = battery_in(self._read(names.battery_type, readable[names.battery].messages[-1]))
            if battery is not None:
                yield battery_result(battery)

    def _mover_results(self, *, move: bool) -> Iterator[CheckResult]:  # noqa: ARG002
        from vsnbench.ros.ros1.service_call import REFUSED

        name = self.names.discrete_move
        try:
            trip_s = self._client().probe()
        except RobotError as error:
            advice = f"start it: vsnbench robots serve {self.profile.argument}"
            if error.code == REFUSED:
                advice = error.advice or "end the server, which has another version of discrete_move/DiscreteServer"
            yield CheckResult(name, Health.FAILED, error.statement, advice)
        else:
            yield CheckResult(name, Health.OK, f"discrete_move/DiscreteServer, {trip_s * 1000:.0f} ms")

    @contextmanager
    def _turn_test(self) -> Iterator[TurnTest]:
        import rospy
        from geometry_msgs.msg import Twist

        self._commands = rospy.Publisher(self.names.command, Twist, queue_size=10, tcp_nodelay=True)
        until_s = time.monotonic() + _CONNECTING_S
        while not self._commands.get_num_connections() and time.monotonic() < until_s:
            time.sleep(_POLL_S)
        try:
            yield self
        finally:
            self.steer(STANDSTILL)

    def _publishers(self, topic: str) -> Sequence[str]:
        return self._state.publishers.get(topic, [])

    def _types_of(self, topic: str) -> frozenset[str]:
        return frozenset({self._types.get(topic, "")} if self._publishers(topic) else ())

    def _has_type(self, topic: str, kind: str) -> bool:
        return self._types.get(topic) == kind

    def _topic_fault(self, topic: str, kind: str, bad: Health) -> CheckResult | None:
        if self._has_type(topic, kind):
            return None
        found = self._types.get(topic, "")
        return CheckResult(topic, bad, f"is a {found}", type_advice(kind, found))

    def _described(self, topic: str, kind: str) -> str:  # noqa: ARG002
        return kind

    def _unpublished_advice(self, *, required: bool) -> str:
        advice = "start its driver, or correct the topic in the profile"
        return f"{advice}; if it runs, the master was restarted after it: restart all nodes" if required else advice

    def _silent_advice(self, topic: str) -> str:
        return f"check that {', '.join(self._publishers(topic))} is alive and can resolve the name of this machine"

    def _read(self, kind: str, data: bytes) -> Any:
        from vsnbench.ros.ros1.subscriptions import message_of

        return message_of(kind, data)

    def _seconds(self, stamp: Any) -> float:
        return float(stamp.to_sec())

    def _remote_nodes(self) -> frozenset[str]:
        here = {"localhost", socket.gethostname(), os.environ.get("ROS_IP", ""), os.environ.get("ROS_HOSTNAME", "")}
        remote = set()
        for node in {node for nodes in self._state.publishers.values() for node in nodes}:
            try:
                host = urlparse(str(self._master.ask("lookupNode", node))).hostname or ""
            except (LookupError, MasterError):
                continue
            if host not in here and not host.startswith("127."):
                remote.add(node)
        return frozenset(remote)

    def turn(self, movement: Move) -> MotionResult | None:
        """Turn the robot by the server of discrete_move; see `TurnTest.turn`.

        Raises:
            RobotError: the server does not answer.
        """
        from vsnbench.ros.ros1.messages import DiscreteServerRequest
        from vsnbench.ros.ros1.service_words import words_of

        words = words_of(movement)
        assert words is not None  # noqa: S101  # a turn of whole degrees
        before, timeout_s = self._heading_rad(), turn_timeout_s(movement, self.profile)
        answered = bool(self._client().call(DiscreteServerRequest(*words), timeout_s).response)
        after = self._heading_rad()
        if before is None or after is None:
            return None
        return MotionResult(answered, turn_rad=math.remainder(after - before, math.tau))

    @property
    def now_s(self) -> float:
        """Time on the clock of the arrivals of messages."""
        return time.time()

    def steer(self, command: Command) -> None:
        """Command a velocity."""
        from vsnbench.ros.ros1.messages import twist_message

        self._commands.publish(twist_message(command))

    def latest(self) -> Sequence[OdometryReading]:
        """Return the newest readings of the odometry, oldest first."""
        if self.names.tf:
            return self.transforms.latest(_LATEST)
        return [
            OdometryReading(Pose(*planar(message)), self._seconds(message.header.stamp), arrival_s)
            for data, arrival_s in self.listener.monitor.recent(self.names.odometry, _LATEST)
            if (message := self._read("nav_msgs/Odometry", data))
        ]

    def hazard(self) -> str:
        """Return the active hazard sensors, or an empty string."""
        return self.hazards.text

    def _heading_rad(self) -> float | None:
        """Return the heading of the odometry after a motion has settled; None without odometry."""
        if self.names.tf:
            return self.transforms.settled_heading_rad()
        data = self.listener.monitor.settled(self.names.odometry)
        return None if data is None else planar(self._read("nav_msgs/Odometry", data))[2]

    def newest_images(self) -> Mapping[str, Any]:
        """Return the newest images of `image_topics` that arrive from now on, without those that do not."""
        received = self.listener.listen(_IMAGES_S)
        topics = image_topics(self.names)
        return {
            what: self._read(image_type(topic), received[topic].messages[-1])
            for what, topic in topics.items()
            if self._has_type(topic, image_type(topic)) and received[topic].messages
        }

    def _client(self) -> ServiceClient:
        from vsnbench.ros.ros1.messages import DiscreteServer
        from vsnbench.ros.ros1.service_call import ServiceClient

        return ServiceClient(self.names.discrete_move, DiscreteServer, replace(self._master, caller=_NODE))


def _own_address(master: Master) -> CheckResult:
    """Return whether other machines can reach the address that this machine registers."""
    given = os.environ.get("ROS_IP") or os.environ.get("ROS_HOSTNAME")
    remote = urlparse(master.uri).hostname not in ("localhost", "127.0.0.1", socket.gethostname())
    if given:
        if remote and (given.startswith("127.") or given == "localhost"):
            seen = f"{given}, but the master is on another machine"
            return CheckResult("own address", Health.FAILED, seen, "set ROS_IP to the address of this machine")
        return CheckResult("own address", Health.OK, given)
    if remote:
        seen = f"neither ROS_IP nor ROS_HOSTNAME is set: the robot must resolve {socket.gethostname()}"
        return CheckResult("own address", Health.WARNING, seen, "export ROS_IP=<address of this machine>")
    return CheckResult("own address", Health.OK, "this machine only")
