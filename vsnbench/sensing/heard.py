"""What came on a topic while somebody listened: how often, how old, from whom, and the last messages as bytes."""

from dataclasses import dataclass, field


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
