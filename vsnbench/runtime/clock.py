"""Changes of the computer's clock, by which episodes are dated."""

import time
from dataclasses import dataclass, field

_STEADY = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""A clock that cannot be set; it keeps running while the computer sleeps."""


@dataclass(frozen=True, slots=True)
class ClockReading:
    """Readings of the computer's clock and of a clock that cannot be set, taken together."""

    date_s: float = field(default_factory=time.time)
    steady_s: float = field(default_factory=lambda: time.clock_gettime(_STEADY))

    def change_until_s(self, later: "ClockReading") -> float:
        """Return by how many seconds the clock was set forward between two readings; negative for back."""
        return (later.date_s - self.date_s) - (later.steady_s - self.steady_s)
