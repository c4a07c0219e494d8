"""Statistics of the messages on topics: rate, age, senders, and the last messages as bytes."""

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, field

_LARGE_KEPT = 12
_SMALL_KEPT = 200
"""Number of kept messages that are not images: enough to measure the noise of odometry."""
_SMALL_BYTES = 4096
SETTLING_S = 0.3


@dataclass
class TopicMessages:
    """Messages received on one topic."""

    arrivals: list[float] = field(default_factory=list)
    """Arrival times on the clock of this machine."""
    stamps: list[float] = field(default_factory=list)
    """Stamps in the headers of the messages."""
    messages: list[bytes] = field(default_factory=list)
    """The last few messages."""
    senders: set[str] = field(default_factory=set)
    """Nodes that sent them."""

    @property
    def rate_hz(self) -> float:
        """Messages per second."""
        if len(self.arrivals) < 2 or self.arrivals[-1] == self.arrivals[0]:
            return 0.0
        return (len(self.arrivals) - 1) / (self.arrivals[-1] - self.arrivals[0])

    @property
    def offset_s(self) -> float:
        """Smallest difference of arrival and stamp: lag of the sender's clock plus the fastest transport."""
        return min(a - s for a, s in zip(self.arrivals, self.stamps, strict=True))

    @property
    def age_s(self) -> float:
        """Age of the last message on arrival, by its stamp."""
        return self.arrivals[-1] - self.stamps[-1]


class TopicMonitor:
    """Records messages of several topics; thread-safe."""

    def __init__(self, topics: Iterable[str]) -> None:
        self._lock = threading.Lock()
        self._topics = {topic: TopicMessages() for topic in topics}

    def add(self, topic: str, data: bytes, sender: str, *, arrival_s: float, stamp_s: float) -> None:
        """Record a message; `sender` is empty if it is unknown."""
        with self._lock:
            record = self._topics[topic]
            record.arrivals.append(arrival_s)
            record.stamps.append(stamp_s)
            record.messages.append(data)
            record.senders |= {sender} - {""}
            del record.messages[: -(_SMALL_KEPT if len(data) < _SMALL_BYTES else _LARGE_KEPT)]

    def listen(self, connecting_s: float, seconds: float) -> dict[str, TopicMessages]:
        """Drop the messages of the first `connecting_s`, and return those of the `seconds` after."""
        time.sleep(connecting_s)
        with self._lock:
            for topic in self._topics:
                self._topics[topic] = TopicMessages()
        time.sleep(seconds)
        with self._lock:
            return dict(self._topics)

    def recent(self, topic: str, count: int) -> list[tuple[bytes, float]]:
        """Return the last messages of a topic and their arrivals, oldest first."""
        with self._lock:
            record = self._topics[topic]
            messages = record.messages[-count:]
            return list(zip(messages, record.arrivals[len(record.arrivals) - len(messages) :], strict=True))

    def settled(self, topic: str) -> bytes | None:
        """Return the newest message after a motion has settled; None if there is none."""
        time.sleep(SETTLING_S)
        with self._lock:
            messages = self._topics[topic].messages if topic in self._topics else []
            return messages[-1] if messages else None
