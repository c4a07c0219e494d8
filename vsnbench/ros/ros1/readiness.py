"""Checks that every part of a robot on a ROS 1 network answers."""

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from vsnbench.errors import RobotError
from vsnbench.ros.common.readiness import Readiness
from vsnbench.ros.ros1.graph import OTHER_STEERING, graph_faults, steering_nodes, unregistered_publisher
from vsnbench.ros.ros1.interface import Ros1Interface
from vsnbench.ros.ros1.master import Master, MasterError, SystemState
from vsnbench.ros.ros1.service_call import ServiceClient
from vsnbench.sensing.robot_reports import RobotSnapshot


@dataclass
class Ros1Readiness(Readiness):
    """Finds the first part of a robot that does not answer."""

    names: Ros1Interface
    master: Master
    discrete_move: ServiceClient
    steering: frozenset[str] = field(init=False, default=frozenset())
    """Nodes that execute the movements of this session."""
    _state: SystemState = field(init=False, default_factory=lambda: SystemState({}, {}, {}))
    _topic_types: Mapping[str, str] = field(init=False, default_factory=dict)

    def _network_fault(self) -> RobotError | None:
        names, master = self.names, self.master
        try:
            state, types = master.state(), master.topic_types()
        except MasterError as error:
            return error
        self._state, self._topic_types = state, types
        if master.caller not in state.subscribers.get(names.odometry_topic, []):
            raise RobotError(
                f"the master at {master.uri} was restarted and has no registration of this session",
                advice="restart all nodes (driver, camera, discrete_move), then repeat the command",
                code="master-restarted",
            )
        for fault in graph_faults(names, state, types, frozenset({master.caller})):
            if fault.fatal:
                return fault.error
            if not (self.others_drive and fault.code == OTHER_STEERING):
                self._warn_once(str(fault.error))
        self.steering = steering_nodes(names, state, types)
        return None

    def _server_fault(self, now: RobotSnapshot) -> RobotError | None:
        now_s = time.monotonic()
        for topic in (self.names.odometry_topic, self.names.color, self.names.depth):
            senders = now.publishers(topic, now_s) if topic else []
            if (fault := unregistered_publisher(topic, senders, self._state)) is not None:
                return fault.error
        try:
            self.discrete_move.probe()
        except RobotError as error:
            start = f"(vsnbench robots serve {self.profile.argument})"
            return RobotError(error.statement, advice=f"{error.advice} {start}".strip(), code=error.code)
        if not self.steering:  # the server was registered after the master was asked who steers
            return self._network_fault()
        return None

    def _publishers(self, topic: str) -> list[str]:
        return self._state.publishers.get(topic, [])

    def _types(self, topic: str) -> Collection[str]:
        return {self._topic_types.get(topic, "")} if self._publishers(topic) else ()

    def _silence(self, what: str, topic: str, driver: str) -> RobotError:
        if nodes := " and ".join(self._publishers(topic)):
            statement = f"no {what} on {topic}, which {nodes} publishes"
            advice = f"check that {nodes} is alive, and check ROS_IP and the cables"
        else:
            statement = f"no {what} on {topic}"
            advice = f"start {driver}; if it runs, the master was restarted after it: restart all nodes"
        return RobotError(statement, advice=advice, code="silent-topic")
