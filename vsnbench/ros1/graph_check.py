"""What the master's registrations say about a robot's network: who steers the base, who publishes what.

Pure: it is handed what the master answered and knows no connection.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from vsnbench.errors import RobotError
from vsnbench.ros1.interface import Ros1Interface
from vsnbench.ros1.master import SystemState

_TWIST = "geometry_msgs/Twist"


@dataclass(frozen=True, slots=True)
class GraphFault:
    """One thing that is wrong with who publishes, serves or listens."""

    name: str
    """The topic or service."""
    seen: str
    advice: str
    fatal: bool = True
    """No episode may begin with it."""

    @property
    def error(self) -> RobotError:
        """The fault for those whom it keeps from going on."""
        return RobotError(f"{self.name}: {self.seen}", advice=self.advice)


def graph_faults(
    names: Ros1Interface, state: SystemState, types: Mapping[str, str], bystanders: frozenset[str] = frozenset()
) -> list[GraphFault]:
    """Return what is wrong among the nodes that the master knows, the worst first.

    Args:
        names: the robot's topics and services.
        state: what the master answered.
        types: message type by topic, as the master knows them.
        bystanders: our own nodes that may command zero velocity: the client, the doctor.
    """
    return [
        *_published_twice(names, state),
        *_steered_elsewhere(names, state, types),
        *_steered_by_others(names, state, bystanders),
    ]


def server_of(name: str, state: SystemState) -> str:
    """Return the node that serves a service; empty when nobody does."""
    return next(iter(state.services.get(name, [])), "")


def unknown_to_master(topic: str, nodes: list[str], state: SystemState) -> GraphFault | None:
    """Return the fault of nodes that publish to us while the master does not know it."""
    unknown = [node for node in nodes if node not in state.publishers.get(topic, [])]
    if not unknown:
        return None
    return GraphFault(
        topic,
        f"{' and '.join(unknown)} publishes it, but the master does not know",
        "restart that node (the master may have been restarted after it)",
    )


def _published_twice(names: Ros1Interface, state: SystemState) -> list[GraphFault]:
    faults = []
    for topic in (
        *(names.odometry, names.color, names.color_info, names.depth, names.depth_info),
        *(names.bumper, names.cliff, names.wheel_drop, names.battery),
    ):
        nodes = sorted(set(state.publishers.get(topic, []))) if topic else []
        if len(nodes) > 1:
            faults.append(GraphFault(topic, f"{' and '.join(nodes)} both publish it", "end one of them"))
    return faults


def _steered_elsewhere(names: Ros1Interface, state: SystemState, types: Mapping[str, str]) -> list[GraphFault]:
    """A server of discrete_move whose velocities do not reach the base, directly or through one relay."""
    server = server_of(names.discrete_move, state)
    if not server or server in state.publishers.get(names.command, []):
        return []
    steered = [t for t, nodes in state.publishers.items() if server in nodes and types.get(t) == _TWIST]
    relays = set(state.publishers.get(names.command, []))
    if any(relays & set(state.subscribers.get(topic, [])) for topic in steered):
        return []
    return [
        GraphFault(
            names.discrete_move,
            f"its server {server} steers {' and '.join(sorted(steered)) or 'nothing'}, "
            f"but the base listens on {names.command}",
            "remap the server's topic to the base's",
        )
    ]


def _steered_by_others(names: Ros1Interface, state: SystemState, bystanders: frozenset[str]) -> list[GraphFault]:
    server = server_of(names.discrete_move, state)
    others = sorted(set(state.publishers.get(names.command, [])) - bystanders - {server})
    if not others:
        return []
    return [
        GraphFault(
            names.command,
            f"{', '.join(others)} can steer the base, too",
            "end it, unless it only passes commands on",
            fatal=False,
        )
    ]
