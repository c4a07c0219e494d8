"""Checks that every part of a robot on a ROS 1 network answers."""

import time
from collections.abc import Callable

from vsnbench.errors import RobotError
from vsnbench.ros1.graph import graph_faults, steering_nodes, unregistered_publisher
from vsnbench.ros1.interface import Ros1Interface
from vsnbench.ros1.master import Master, MasterError, SystemState
from vsnbench.ros1.service_call import ServiceClient
from vsnbench.ros_common import readiness
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.values.robot_profile import RobotProfile


class Readiness(readiness.Readiness):
    """Finds the first part of a robot that does not answer.

    Attributes:
        steering: nodes that execute the movements of this session.
    """

    names: Ros1Interface

    def __init__(
        self,
        profile: RobotProfile,
        names: Ros1Interface,
        snapshot: Callable[[], RobotSnapshot],
        odometry_fault: Callable[[], str],
        master: Master,
        discrete_move: ServiceClient,
    ) -> None:
        super().__init__(names, snapshot, odometry_fault)
        self._profile_name = profile.name
        self._master = master
        self._discrete_move = discrete_move
        self._state = SystemState({}, {}, {})
        self.steering: frozenset[str] = frozenset()

    def _network_fault(self) -> RobotError | None:
        names, master = self.names, self._master
        try:
            state, types = master.state(), master.topic_types()
        except MasterError as error:
            return error
        self._state = state
        if master.caller not in state.subscribers.get(names.odometry_topic, []):
            raise RobotError(
                f"the master at {master.uri} was restarted and has no registration of this session",
                advice="restart all nodes (driver, camera, discrete_move), then repeat the command",
                code="master-restarted",
            )
        for fault in graph_faults(names, state, types, frozenset({master.caller})):
            if fault.fatal:
                return fault.error
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
            self._discrete_move.probe()
        except RobotError as error:
            start = f"(vsnbench robots serve {self._profile_name})"
            return RobotError(error.statement, advice=f"{error.advice} {start}".strip(), code=error.code)
        return None

    def _publishers(self, topic: str) -> list[str]:
        return self._state.publishers.get(topic, [])

    def _silence(self, what: str, topic: str, driver: str) -> RobotError:
        if nodes := " and ".join(self._publishers(topic)):
            statement = f"no {what} on {topic}, which {nodes} publishes"
            advice = f"check that {nodes} is alive, and check ROS_IP and the cables"
        else:
            statement = f"no {what} on {topic}"
            advice = f"start {driver}; if it runs, the master was restarted after it: restart all nodes"
        return RobotError(statement, advice=advice, code="silent-topic")
