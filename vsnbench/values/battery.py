"""State of a robot's battery as its base reports it."""

import math
from dataclasses import dataclass
from typing import Self

LOW_SHARE = 0.25
"""Share below which a session begins with a warning."""


@dataclass(frozen=True, slots=True)
class Battery:
    """State of a battery: charge, or voltage if the base reports no charge."""

    share: float | None
    """0 empty, 1 full; None if unknown."""
    voltage_v: float | None = None

    @classmethod
    def reported(cls, share: float, voltage_v: float) -> Self | None:
        """Return a reported state; None if nothing was measured.

        Args:
            share: 0 to 1, or NaN if not measured; values above 1 are percent, which some drivers send.
            voltage_v: volts; NaN or 0 if not measured.
        """
        share = share / 100 if 1 < share <= 100 else share
        known = share if 0 <= share <= 1 else None
        volts = voltage_v if math.isfinite(voltage_v) and voltage_v > 0 else None
        return None if known is None and volts is None else cls(known, volts)

    @property
    def is_low(self) -> bool:
        """Whether it should be charged before a session."""
        return self.share is not None and self.share < LOW_SHARE

    @property
    def text(self) -> str:
        """Charge as text, or the voltage if unknown."""
        return f"{self.share:.0%}" if self.share is not None else f"{self.voltage_v:.1f} V"


def course_of(first: Battery | None, last: Battery | None) -> str:
    """Return the change of a battery's state as text, or an empty string if unknown."""
    return " to ".join(dict.fromkeys(battery.text for battery in (first, last) if battery is not None))
