"""Odometry processing (paper, Section 3.1.4): checked, and the heading unwrapped.

Pure: it is fed what messages carry and knows no ROS.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

from vsnbench.protocol.pose import Pose, wrap_angle

_JUMP_MARGIN_M = 0.10
_JUMP_MARGIN_RAD = math.radians(15)
_JUMP_FACTOR = 1.5
"""Faster than this times the base's limit, beyond the margin, is no motion but a jump."""


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """One measurement of a base: its raw pose (heading unwrapped), when it was taken and when it arrived."""

    pose: Pose
    stamp_s: float
    """On the robot's clock."""
    arrival_s: float
    """On this process's monotonic clock."""


class OdometryFaultKind(StrEnum):
    """What can be wrong with a reading."""

    NOT_FINITE = "not finite"
    """It was dropped."""
    JUMPED = "jumped"
    """It was kept: the base may have been reset."""


@dataclass(frozen=True, slots=True)
class OdometryFault:
    """What is wrong with one reading."""

    kind: OdometryFaultKind
    words: str


def heading_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Return the heading of an orientation, radians in (-pi, pi]; NaN when it is no orientation."""
    norm = x * x + y * y + z * z + w * w
    if not math.isfinite(norm) or norm < 0.5:
        return math.nan
    return math.atan2(2 * (w * z + x * y), norm - 2 * (y * y + z * z))


class OdometryTracker:
    """Follows one base's odometry: notices readings that cannot be true."""

    def __init__(self, max_linear_m_s: float, max_angular_rad_s: float) -> None:
        self._max_linear_m_s = max_linear_m_s
        self._max_angular_rad_s = max_angular_rad_s
        self.latest: OdometryReading | None = None

    def add(self, x_m: float, y_m: float, heading_rad: float, stamp_s: float, arrival_s: float) -> OdometryFault | None:
        """Take one measurement; return what is wrong with it, None when nothing is.

        A reading that is not finite is dropped. One that jumped is kept, for the base may have been reset; the
        heading is unwrapped against the last one either way.
        """
        if not all(map(math.isfinite, (x_m, y_m, heading_rad, stamp_s))):
            words = f"odometry is not finite: x {x_m:g}, y {y_m:g}, heading {heading_rad:g}"
            return OdometryFault(OdometryFaultKind.NOT_FINITE, words)
        last = self.latest
        if last is None:
            self.latest = OdometryReading(Pose(x_m, y_m, heading_rad), stamp_s, arrival_s)
            return None
        turned_rad = wrap_angle(heading_rad - last.pose.heading_rad)
        pose = Pose(x_m, y_m, last.pose.heading_rad + turned_rad)
        self.latest = OdometryReading(pose, stamp_s, arrival_s)
        # Whichever clock saw more time pass: a late message is no jump, and neither is a stamp that stands still.
        elapsed_s = max(stamp_s - last.stamp_s, arrival_s - last.arrival_s, 0.0)
        moved_m = pose.distance_to(last.pose)
        if moved_m > _JUMP_FACTOR * self._max_linear_m_s * elapsed_s + _JUMP_MARGIN_M:
            return _jumped(f"{moved_m:.2f} m", elapsed_s)
        if abs(turned_rad) > _JUMP_FACTOR * self._max_angular_rad_s * elapsed_s + _JUMP_MARGIN_RAD:
            return _jumped(f"{math.degrees(turned_rad):.0f}°", elapsed_s)
        return None


def _jumped(far: str, elapsed_s: float) -> OdometryFault:
    return OdometryFault(OdometryFaultKind.JUMPED, f"odometry jumped {far} in {elapsed_s:.2f} s")


class ClockOffset:
    """How far another machine's clock is from ours, from its stamps and when they arrived here.

    The smallest difference of the last messages is the one that waited least on its way, so it takes out transport
    delays and clock skew alike; `to_local` then says when a message was really stamped.
    """

    def __init__(self, window: int = 200) -> None:
        self._differences: deque[float] = deque(maxlen=window)
        self.offset_s = 0.0

    def add(self, stamp_s: float, arrival_s: float) -> None:
        """Take the stamp and arrival of one message."""
        self._differences.append(arrival_s - stamp_s)
        self.offset_s = min(self._differences)

    def to_local(self, stamp_s: float) -> float:
        """Return a stamp on our clock."""
        return stamp_s + self.offset_s
