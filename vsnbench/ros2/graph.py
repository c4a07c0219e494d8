"""Asks the ROS 2 graph who publishes and listens; imported only where ROS 2 is installed."""

from typing import Any

from vsnbench.ros2.graph_check import Endpoint
from vsnbench.ros2.node import Ros2Node


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
