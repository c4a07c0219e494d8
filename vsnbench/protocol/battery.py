"""How full a robot's battery is, as its base says, and how that is said to people; nothing is concluded from it."""

import math
from dataclasses import dataclass
from typing import Self

LOW_SHARE = 0.25
"""A battery that holds less is worth a warning before a session."""


@dataclass(frozen=True, slots=True)
class Battery:
    """What a base says of its battery: how full it is, or its voltage where it says no more."""

    share: float | None
    """0 empty, 1 full; None where the base does not say."""
    voltage_v: float | None = None

    @classmethod
    def reported(cls, share: float, voltage_v: float) -> Self | None:
        """Return what a base reports; None where that is no measurement at all.

        Args:
            share: 0 to 1; NaN where it is not measured. Some drivers send
                percent: above 1 it is taken as that.
            voltage_v: volts; NaN or 0 where they are not measured.
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
    def words(self) -> str:
        """For people: how full, or else the voltage."""
        return f"{self.share:.0%}" if self.share is not None else f"{self.voltage_v:.1f} V"


def course_of(first: Battery | None, last: Battery | None) -> str:
    """Return in words from what to what a battery went; empty where nothing is known of it."""
    said = [one.words for one in (first, last) if one is not None]
    return " to ".join(dict.fromkeys(said))
