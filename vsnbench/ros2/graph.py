"""Asks the ROS 2 graph who publishes and listens; imported only where ROS 2 is installed."""

from collections.abc import Sequence
from typing import Any

from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy

from vsnbench.errors import RobotError
from vsnbench.ros2.graph_check import Endpoint
from vsnbench.ros2.node import Ros2Node

_RELIABLE, _LASTING = QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.TRANSIENT_LOCAL
_FOR_EVER_NS = 365 * 24 * 3600 * 10**9
"""A duration beyond it is how the middleware says that there is none."""


class Graph:
    """What this node has discovered until now; nodes that were killed stay in it for some seconds."""

    def __init__(self, node: Ros2Node) -> None:
        self._node = node
        self._labels: dict[bytes, str] = {}
        self._topic_labels: dict[str, list[str]] = {}

    def publishers(self, topic: str) -> list[Endpoint]:
        """Return who publishes a topic."""
        return [_endpoint(one) for one in self._node.rclpy.get_publishers_info_by_topic(topic)] if topic else []

    def subscribers(self, topic: str) -> list[Endpoint]:
        """Return who listens to a topic."""
        return [_endpoint(one) for one in self._node.rclpy.get_subscriptions_info_by_topic(topic)] if topic else []

    def nodes(self) -> list[str]:
        """Return every node's full name."""
        found = self._node.rclpy.get_node_names_and_namespaces()
        return [f"{namespace.rstrip('/')}/{name}" for name, namespace in found]

    def sender(self, topic: str, info: Any) -> str:
        """Return the node that published a message: two of one name are told apart; empty while it is not known."""
        gid = bytes(info["publisher_gid"]["data"])
        if gid not in self._labels:
            name = next((one.node for one in self.publishers(topic) if one.gid == gid), "")
            if not name or "_UNKNOWN_" in name:
                # The endpoint is known before the node that it belongs to.
                return ""
            others = self._topic_labels.setdefault(topic, [])
            taken = sum(label == name or label.startswith(f"{name} (") for label in others)
            self._labels[gid] = f"{name} (no. {taken + 1})" if taken else name
            others.append(self._labels[gid])
        return self._labels[gid]


def incompatibility(publisher: QoSProfile, listeners: Sequence[Endpoint]) -> RobotError | None:
    """Return the listener that will never hear a publisher, and why; None when all do."""
    for one in listeners:
        asks = one.qos
        unmet = [
            what
            for what, fails in (
                ("reliable", asks.reliability == _RELIABLE and publisher.reliability != _RELIABLE),
                ("transient local", asks.durability == _LASTING and publisher.durability != _LASTING),
                ("a deadline", 0 < asks.deadline.nanoseconds < _FOR_EVER_NS),
                ("a lease of liveliness", 0 < asks.liveliness_lease_duration.nanoseconds < _FOR_EVER_NS),
            )
            if fails
        ]
        if unmet:
            return RobotError(
                f"{one.node} asks for {' and '.join(unmet)} and would never hear what is sent {words(publisher)}",
                advice="set its quality of service to what drivers use, best effort and volatile",
            )
    return None


def words(qos: QoSProfile) -> str:
    """Return a quality of service in the words of ROS."""
    reliable = "reliable" if qos.reliability == _RELIABLE else "best effort"
    return f"{reliable} and {'transient local' if qos.durability == _LASTING else 'volatile'}"


def _endpoint(info: Any) -> Endpoint:
    described = str(getattr(info, "topic_type_hash", "") or "")
    type_hash = described if described.startswith("RIHS") else ""
    return Endpoint(
        node=f"{info.node_namespace.rstrip('/')}/{info.node_name}",
        type_name=info.topic_type,
        type_hash="" if set(type_hash.partition("_")[2]) <= {"0"} else type_hash,
        qos=info.qos_profile,
        gid=bytes(info.endpoint_gid),
    )
