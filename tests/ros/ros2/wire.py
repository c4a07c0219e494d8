"""Endpoints and text topics of a ROS 2 graph, without ROS."""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

from vsnbench.ros.ros2.graph import Endpoint

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


def qos(reliability="BEST_EFFORT", durability="VOLATILE", deadline_s=0.0, lease_s=0.0):
    return SimpleNamespace(
        reliability=SimpleNamespace(name=reliability),
        durability=SimpleNamespace(name=durability),
        deadline=SimpleNamespace(nanoseconds=int(deadline_s * 1e9)),
        liveliness_lease_duration=SimpleNamespace(nanoseconds=int(lease_s * 1e9)),
    )


def base(node="/base", kind=TWIST, type_hash="", **quality) -> Endpoint:
    return Endpoint(node, kind, type_hash, qos(**quality))


@dataclass
class Wire:
    """Text topics for a TopicServiceClient and its server; the first `lost` texts are dropped."""

    takers: dict[str, list[Callable[[str], None]]] = field(default_factory=dict)
    sent: list[tuple[str, str]] = field(default_factory=list)
    lost: int = 0

    def text_publisher(self, topic: str) -> Callable[[str], None]:
        def publish(text: str) -> None:
            self.sent.append((topic, text))
            if len(self.sent) > self.lost:
                for take in self.takers.get(topic, []):
                    take(text)

        return publish

    def subscribe_text(self, topic: str, take: Callable[[str], None]) -> None:
        self.takers.setdefault(topic, []).append(take)
