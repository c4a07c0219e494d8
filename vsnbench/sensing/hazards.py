"""Hazard sensors of a base."""

from collections.abc import Callable
from enum import StrEnum


class Hazard(StrEnum):
    """Kind of a hazard sensor."""

    BUMPER = "bumper"
    CLIFF = "cliff"
    WHEEL_DROP = "wheel drop"


TakeHazard = Callable[[Hazard, int, bool, str], None]
"""Takes the hazard, the number of the sensor, whether it is active, and its position on the base."""
