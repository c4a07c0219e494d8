"""Listens to topics of any type: how often something comes, how old it is, and the last messages as bytes.

Imported only where ROS is installed.
"""

import struct
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import rospy
from nav_msgs.msg import Odometry

from vsnbench.ros1.node import start_node
from vsnbench.sensing.odometry import heading_of_quaternion

_KEEP = 12


@dataclass
class Heard:
    """What came on one topic."""

    arrivals: list[float] = field(default_factory=list)
    """ROS time of each message's arrival."""
    stamps: list[float] = field(default_factory=list)
    """The stamp that each message carries, where its type begins with a header."""
    messages: list[bytes] = field(default_factory=list)
    """The last few messages."""
    senders: set[str] = field(default_factory=set)
    """The nodes that sent them."""

    @property
    def rate_hz(self) -> float:
        """Messages a second."""
        if len(self.arrivals) < 2 or self.arrivals[-1] == self.arrivals[0]:
            return 0.0
        return (len(self.arrivals) - 1) / (self.arrivals[-1] - self.arrivals[0])

    @property
    def offset_s(self) -> float:
        """Smallest arrival minus stamp: how far the sender's clock is behind ours, plus the fastest transport."""
        return min(a - s for a, s in zip(self.arrivals, self.stamps, strict=True))

    @property
    def age_s(self) -> float:
        """Age of the last message on arrival, by its own stamp."""
        return self.arrivals[-1] - self.stamps[-1]


class TopicListener:
    """A node that listens; one a process."""

    def __init__(self, name: str, topics: Sequence[str]) -> None:
        start_node(name)
        self._lock = threading.Lock()
        self._heard = {topic: Heard() for topic in topics}
        for topic in topics:
            rospy.Subscriber(topic, rospy.AnyMsg, self._keeper(topic), queue_size=50, buff_size=1 << 24)

    def listen(self, seconds: float) -> dict[str, Heard]:
        """Wait, and return what has come on each topic since the listener was made."""
        # The first half second is for connecting; rates are those of the rest.
        time.sleep(0.5)
        with self._lock:
            for topic in self._heard:
                self._heard[topic] = Heard()
        time.sleep(seconds)
        with self._lock:
            return dict(self._heard)

    def heading_rad(self, topic: str) -> float | None:
        """Return the heading of the newest odometry, after waiting for it to settle; None when nothing comes."""
        time.sleep(0.3)
        with self._lock:
            data = self._heard[topic].messages[-1:] if topic in self._heard else []
        if not data:
            return None
        turn = Odometry().deserialize(data[0]).pose.pose.orientation
        return heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)

    def close(self) -> None:
        """Leave the ROS network."""
        rospy.signal_shutdown("closed")

    def _keeper(self, topic: str) -> "rospy.AnyMsg":
        def keep(message: "rospy.AnyMsg") -> None:
            data = message._buff  # noqa: SLF001
            arrival_s = rospy.get_time()
            secs, nsecs = struct.unpack_from("<II", data, 4) if len(data) >= 12 else (0, 0)
            with self._lock:
                heard = self._heard[topic]
                heard.arrivals.append(arrival_s)
                heard.stamps.append(secs + nsecs * 1e-9)
                heard.messages.append(data)
                heard.senders.add(str(message._connection_header.get("callerid", "?")))  # noqa: SLF001
                del heard.messages[:-_KEEP]

        return keep
