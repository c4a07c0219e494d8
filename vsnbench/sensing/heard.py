"""What came on a topic while somebody listened: how often, how old, from whom, and the last messages as bytes."""

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, field

_KEEP = 12
_SETTLING_S = 0.3


@dataclass
class Heard:
    """What came on one topic."""

    arrivals: list[float] = field(default_factory=list)
    """The time of each message's arrival, on this machine's clock."""
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


class Hearing:
    """What comes on several topics, fed by the threads of a middleware and asked by another."""

    def __init__(self, topics: Iterable[str]) -> None:
        self._lock = threading.Lock()
        self._heard = {topic: Heard() for topic in topics}

    def keep(self, topic: str, data: bytes, sender: str, *, arrival_s: float, stamp_s: float) -> None:
        """Take a message; an empty sender is one that is not known."""
        with self._lock:
            heard = self._heard[topic]
            heard.arrivals.append(arrival_s)
            heard.stamps.append(stamp_s)
            heard.messages.append(data)
            heard.senders |= {sender} - {""}
            del heard.messages[:-_KEEP]

    def listen(self, connecting_s: float, seconds: float) -> dict[str, Heard]:
        """Wait until everybody is connected, forget what came by then, and return what comes in the seconds after."""
        time.sleep(connecting_s)
        with self._lock:
            for topic in self._heard:
                self._heard[topic] = Heard()
        time.sleep(seconds)
        with self._lock:
            return dict(self._heard)

    def settled(self, topic: str) -> bytes | None:
        """Return the newest message after a motion has settled; None when nothing has come."""
        time.sleep(_SETTLING_S)
        with self._lock:
            kept = self._heard[topic].messages if topic in self._heard else []
            return kept[-1] if kept else None
