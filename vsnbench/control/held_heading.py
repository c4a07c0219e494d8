"""The heading that movements hold: targets follow targets, not measurements, so that errors of turns do not add up."""

import logging
import math

from vsnbench.control.law import turn_error_rad

logger = logging.getLogger(__name__)

_MOVED_BY_HAND_RAD = math.radians(3)
"""A larger difference from the held heading has another cause: the robot was lifted, pushed or reset."""


class HeldHeading:
    """The target heading of the last movement, in the unwrapped frame of the odometry.

    Attributes:
        is_known: whether a movement has ended at its target since the last `forget`.
        error_rad: standard error of the heading from which the held headings began.
    """

    def __init__(self) -> None:
        self._heading_rad: float | None = None
        self.error_rad = 0.0

    @property
    def is_known(self) -> bool:
        """Whether the next movement is relative to a held heading."""
        return self._heading_rad is not None

    def forget(self) -> None:
        """Start the next movement from the measured heading."""
        self._heading_rad = None

    def keep(self, heading_rad: float) -> None:
        """Hold the target of a movement that reached it."""
        self._heading_rad = heading_rad

    def begin(self, error_rad: float) -> None:
        """Take the standard error of the measured heading at the begin of a leg."""
        if self._heading_rad is None:
            self.error_rad = error_rad

    def start_rad(self, measured_rad: float) -> float:
        """Return the heading to which a leg is relative that holds the heading, from that of the robot."""
        if self._heading_rad is None:
            return measured_rad
        off_rad = turn_error_rad(self._heading_rad, measured_rad)
        if abs(off_rad) > _MOVED_BY_HAND_RAD:
            turned_deg = math.degrees(-off_rad)
            logger.warning("turned by %.1f° since the last movement: holding the present heading", turned_deg)
            return measured_rad
        return measured_rad + off_rad
