"""Publishers and subscribers on the ROS 2 graph: their types and quality of service, and checks of them."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, count
from typing import TYPE_CHECKING, Any

from vsnbench.errors import RobotError

if TYPE_CHECKING:
    from vsnbench.ros.ros2.node import Ros2Node

_OWN_NODES = ("vsnbench", "vsnbench_doctor", "discrete_move", "simulated_robot")
"""Names of the nodes of vsnbench; the client appends a number."""
_RELIABLE, _LASTING = "RELIABLE", "TRANSIENT_LOCAL"
_FOR_EVER_NS = 365 * 24 * 3600 * 10**9
"""The middleware reports longer durations where there is no limit."""
_ASKED_EVERY_S = 0.5


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One publisher or subscriber of a topic."""

    node: str
    """Full name of the node."""
    type_name: str
    """Message type, such as `nav_msgs/msg/Odometry`."""
    type_hash: str
    """Hash of the type's definition (REP 2016); empty before the distribution Iron."""
    qos: Any
    gid: bytes = b""

    @property
    def qos_text(self) -> str:
        """Reliability and durability, such as `best effort, volatile`."""
        parts = (self.qos.reliability.name, self.qos.durability.name)
        return ", ".join(part.lower().replace("_", " ") for part in parts)

    @property
    def is_own(self) -> bool:
        """Whether the node belongs to vsnbench."""
        name = self.node.rsplit("/", 1)[-1]
        return name in _OWN_NODES or (name.startswith("vsnbench_") and name.removeprefix("vsnbench_").isdigit())


def bases_of(subscribers: Sequence[Endpoint]) -> list[Endpoint]:
    """Return the subscribers that drive a base: all nodes but the client, the doctor and discrete_move."""
    return [endpoint for endpoint in subscribers if not endpoint.is_own or endpoint.node.endswith("/simulated_robot")]


def command_fault(topic: str, wanted: str, subscribers: Sequence[Endpoint], known: Sequence[str]) -> RobotError | None:
    """Return why no base can be steered on a topic, or None.

    Args:
        topic: topic of the velocities.
        wanted: type in the profile; empty for the type to which the base subscribes.
        subscribers: all subscribers of the topic.
        known: types of velocities.
    """
    bases = bases_of(subscribers)
    if not bases:
        return RobotError(
            f"no base subscribes to velocities on {topic}",
            advice="start the driver of the base in this domain, or correct interface.command in the profile",
            code="no-base",
        )
    kinds = sorted({base.type_name for base in bases})
    if wanted and wanted not in kinds:
        return RobotError(
            f"{bases[0].node} subscribes to {' and '.join(kinds)} on {topic}, the profile has {wanted}",
            advice=f"set interface.command_type to {kinds[0]}",
            code="wrong-command-type",
        )
    if not set(kinds) & set(known):
        return RobotError(
            f"{bases[0].node} subscribes to {' and '.join(kinds)} on {topic}",
            advice=f"the type of a velocity is {' or '.join(known)}",
            code="wrong-command-type",
        )
    return None


def type_fault(topic: str, wanted: str, publishers: Sequence[Endpoint]) -> RobotError | None:
    """Return the fault of a topic with another type than `wanted`; None for the right type or no publisher."""
    kinds = sorted({publisher.type_name for publisher in publishers})
    if not kinds or wanted in kinds:
        return None
    return RobotError(
        f"{topic} is a {' and '.join(kinds)}, not a {wanted}",
        advice="correct the topic in the profile",
        code="wrong-topic-type",
    )


def hash_fault(topic: str, ours: str, theirs: Sequence[Endpoint]) -> str:
    """Return the fault of a publisher that defines a type differently, or an empty string."""
    for publisher in theirs:
        if ours and publisher.type_hash and publisher.type_hash != ours:
            return f"{topic}: {publisher.node} has another definition of {publisher.type_name} than this machine"
    return ""


def incompatibility(publisher: Any, subscribers: Sequence[Endpoint]) -> RobotError | None:
    """Return the fault of a subscriber whose quality of service a publisher does not offer, or None."""
    for subscriber in subscribers:
        asks = subscriber.qos
        unmet = [
            what
            for what, fails in (
                ("reliable", _is(asks.reliability, _RELIABLE) and not _is(publisher.reliability, _RELIABLE)),
                ("transient local", _is(asks.durability, _LASTING) and not _is(publisher.durability, _LASTING)),
                ("a deadline", 0 < asks.deadline.nanoseconds < _FOR_EVER_NS),
                ("a liveliness lease", 0 < asks.liveliness_lease_duration.nanoseconds < _FOR_EVER_NS),
            )
            if fails
        ]
        if unmet:
            return RobotError(
                f"{subscriber.node} requires {' and '.join(unmet)}, but the publisher is {_qos_text(publisher)}",
                advice="set its quality of service to best effort and volatile, as drivers use",
                code="incompatible-qos",
            )
    return None


def _qos_text(qos: Any) -> str:
    reliable = "reliable" if _is(qos.reliability, _RELIABLE) else "best effort"
    return f"{reliable} and {'transient local' if _is(qos.durability, _LASTING) else 'volatile'}"


def _is(policy: Any, name: str) -> bool:
    return bool(policy.name == name)


class Graph:
    """The nodes that this process has discovered; killed nodes stay for some seconds."""

    def __init__(self, node: "Ros2Node") -> None:
        self._node = node
        self._labels: dict[bytes, str] = {}
        self._only: dict[str, tuple[float, bytes]] = {}  # time at which a topic had this publisher alone

    def publishers(self, topic: str) -> list[Endpoint]:
        """Return the publishers of a topic."""
        return [_endpoint(info) for info in self._node.rclpy.get_publishers_info_by_topic(topic)] if topic else []

    def subscribers(self, topic: str) -> list[Endpoint]:
        """Return the subscribers of a topic."""
        return [_endpoint(info) for info in self._node.rclpy.get_subscriptions_info_by_topic(topic)] if topic else []

    def nodes(self) -> list[str]:
        """Return the full name of every node."""
        found = self._node.rclpy.get_node_names_and_namespaces()
        return [f"{namespace.rstrip('/')}/{name}" for name, namespace in found]

    def sender(self, topic: str, info: Any) -> str:
        """Return the node that published a message, or an empty string while it is unknown.

        A number distinguishes two nodes of the same name. Before Kilted, rclpy does not say who published a message: it
        is the only publisher of the topic, and unknown if there are several.
        """
        named = info.get("publisher_gid")
        gid = bytes(named["data"]) if named else self._only_publisher(topic)
        if not gid:
            return ""
        if gid not in self._labels:
            publishers = self.publishers(topic)
            name = next((endpoint.node for endpoint in publishers if endpoint.gid == gid), "")
            if not name or "_UNKNOWN_" in name:
                # Discovery reports an endpoint before its node.
                return ""
            # A node that ended and was started again is one node.
            in_use = {self._labels.get(endpoint.gid) for endpoint in publishers}
            labels = chain([name], (f"{name} (no. {number})" for number in count(2)))
            self._labels[gid] = next(label for label in labels if label not in in_use)
        return self._labels[gid]

    def _only_publisher(self, topic: str) -> bytes:
        """Return the only publisher of a topic, asked for once in a period, or nothing if there are several."""
        now_s = time.monotonic()
        asked_s, gid = self._only.get(topic, (-math.inf, b""))
        if now_s - asked_s > _ASKED_EVERY_S:
            found = self.publishers(topic)
            gid = found[0].gid if len(found) == 1 else b""
            self._only[topic] = now_s, gid
        return gid


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
