"""Checks of the nodes that the ROS master has registered for a robot; pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from vsnbench.errors import RobotError
from vsnbench.ros.ros1.interface import Ros1Interface
from vsnbench.ros.ros1.master import SystemState

_TWIST = "geometry_msgs/Twist"
OTHER_STEERING: Final = "other-steering-node"


@dataclass(frozen=True, slots=True)
class GraphFault:
    """One fault among publishers, subscribers and servers."""

    name: str
    """Topic or service."""
    seen: str
    advice: str
    fatal: bool = True
    """Whether no episode may begin."""
    code: str = "robot"

    @property
    def error(self) -> RobotError:
        """The fault as an error."""
        return RobotError(f"{self.name}: {self.seen}", advice=self.advice, code=self.code)


def graph_faults(
    names: Ros1Interface, state: SystemState, types: Mapping[str, str], own_nodes: frozenset[str] = frozenset()
) -> list[GraphFault]:
    """Return the faults among the registered nodes, the worst first."""
    return [
        *_published_twice(names, state),
        *_steered_elsewhere(names, state, types),
        *_steered_by_others(names, state, own_nodes),
    ]


def server_of(name: str, state: SystemState) -> str:
    """Return the node that serves a service, or an empty string."""
    return next(iter(state.services.get(name, [])), "")


def steering_nodes(names: Ros1Interface, state: SystemState, types: Mapping[str, str]) -> frozenset[str]:
    """Return the nodes that publish the velocities of discrete_move on the command topic.

    That is the server itself, or the nodes that relay its velocities.
    """
    server = server_of(names.discrete_move, state)
    publishers = set(state.publishers.get(names.command, []))
    if server in publishers:
        return frozenset({server})
    steered = _steered_topics(server, state, types)
    return frozenset(node for topic in steered for node in publishers & set(state.subscribers.get(topic, [])))


def unregistered_publisher(topic: str, nodes: list[str], state: SystemState) -> GraphFault | None:
    """Return the fault of nodes that publish a topic without a registration at the master."""
    unknown = [node for node in nodes if node not in state.publishers.get(topic, [])]
    if not unknown:
        return None
    return GraphFault(
        topic,
        f"{' and '.join(unknown)} publishes it, but is not registered at the master",
        "restart that node; the master may have been restarted after it",
        code="unregistered-publisher",
    )


def _steered_topics(server: str, state: SystemState, types: Mapping[str, str]) -> list[str]:
    return [topic for topic, nodes in state.publishers.items() if server in nodes and types.get(topic) == _TWIST]


def _published_twice(names: Ros1Interface, state: SystemState) -> list[GraphFault]:
    faults = []
    for topic in (
        *(names.odometry, names.color, names.color_info, names.depth, names.depth_info, names.battery),
        *(part.topic for part in names.hazard_topics),
    ):
        nodes = sorted(set(state.publishers.get(topic, []))) if topic else []
        if len(nodes) > 1:
            seen = f"{' and '.join(nodes)} both publish it"
            faults.append(GraphFault(topic, seen, "end one of them", code="two-publishers"))
    return faults


def _steered_elsewhere(names: Ros1Interface, state: SystemState, types: Mapping[str, str]) -> list[GraphFault]:
    """Return the fault of a discrete_move server whose velocities do not reach the base, directly or by a relay."""
    server = server_of(names.discrete_move, state)
    if not server or server in state.publishers.get(names.command, []) or steering_nodes(names, state, types):
        return []
    steered = " and ".join(sorted(_steered_topics(server, state, types))) or "no topic"
    return [
        GraphFault(
            names.discrete_move,
            f"its server {server} commands velocities on {steered}, but the base subscribes to {names.command}",
            "remap the server's topic to that of the base",
            code="steers-another-topic",
        )
    ]


def _steered_by_others(names: Ros1Interface, state: SystemState, own_nodes: frozenset[str]) -> list[GraphFault]:
    server = server_of(names.discrete_move, state)
    others = sorted(set(state.publishers.get(names.command, [])) - own_nodes - {server})
    if not others:
        return []
    return [
        GraphFault(
            names.command,
            f"{', '.join(others)} can also steer the base",
            "end that node, unless it only relays commands",
            fatal=False,
            code=OTHER_STEERING,
        )
    ]
