"""Checks of odometry, and unwrapping of its heading (paper, Section 3.1.4)."""

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from vsnbench.values.pose import Pose, wrap_angle

_JUMP_MARGIN_M = 0.10
_JUMP_MARGIN_RAD = math.radians(15)
_JUMP_FACTOR = 1.5
"""A change is a jump if it exceeds the margin plus this factor times the base's velocity limit."""


@dataclass(frozen=True, slots=True)
class PlanarReading:
    """One odometry message: metres, radians, seconds on the robot's clock."""

    x_m: float
    y_m: float
    heading_rad: float
    stamp_s: float
    rotation: tuple[float, float, float, float] = field(default=(0.0, 0.0, 0.0, 1.0), compare=False)
    """Orientation x, y, z, w that has the heading."""


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """One measurement of a base; its heading is unwrapped."""

    pose: Pose
    stamp_s: float
    """Time of the measurement on the robot's clock."""
    arrival_s: float
    """Time of arrival on the monotonic clock of this process."""


@dataclass(frozen=True, slots=True)
class OdometryFault:
    """Fault of one reading."""

    text: str
    is_dropped: bool = False
    """Whether the reading was dropped, because it is not finite; a jump is kept, the base may have been reset."""


def heading_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Return the heading of an orientation, radians in (-pi, pi]; NaN for an invalid quaternion."""
    norm = x * x + y * y + z * z + w * w
    if not math.isfinite(norm) or norm < 0.5:
        return math.nan
    return math.atan2(2 * (w * z + x * y), norm - 2 * (y * y + z * z))


def pose_at(readings: Sequence[OdometryReading], stamp_s: float) -> Pose | None:
    """Return the pose at a time on the robot's clock, interpolated between two readings.

    A time after the newest reading has its pose. None for a time before the oldest, and without readings.

    Args:
        readings: oldest first.
        stamp_s: the time.
    """
    after = bisect_left(readings, stamp_s, key=lambda reading: reading.stamp_s)
    if after == len(readings):
        return readings[-1].pose if readings else None
    later = readings[after]
    if after == 0:
        return later.pose if later.stamp_s == stamp_s else None
    earlier = readings[after - 1]
    share = (stamp_s - earlier.stamp_s) / (later.stamp_s - earlier.stamp_s)
    a, b = earlier.pose, later.pose
    return Pose(
        a.x_m + share * (b.x_m - a.x_m),
        a.y_m + share * (b.y_m - a.y_m),
        a.heading_rad + share * (b.heading_rad - a.heading_rad),
    )


class OdometryTracker:
    """Detects invalid readings in the odometry of one base."""

    def __init__(self, max_linear_m_s: float, max_angular_rad_s: float) -> None:
        self._max_linear_m_s = max_linear_m_s
        self._max_angular_rad_s = max_angular_rad_s
        self.latest: OdometryReading | None = None

    def add(self, x_m: float, y_m: float, heading_rad: float, stamp_s: float, arrival_s: float) -> OdometryFault | None:
        """Add a measurement; return its fault or None.

        A reading that is not finite is dropped. A jump is kept, because the base may have been reset. The heading is
        unwrapped against the last one.
        """
        if not all(map(math.isfinite, (x_m, y_m, heading_rad, stamp_s))):
            text = f"odometry is not finite: x {x_m:g}, y {y_m:g}, heading {heading_rad:g}"
            return OdometryFault(text, is_dropped=True)
        last = self.latest
        if last is None:
            self.latest = OdometryReading(Pose(x_m, y_m, heading_rad), stamp_s, arrival_s)
            return None
        turned_rad = wrap_angle(heading_rad - last.pose.heading_rad)
        pose = Pose(x_m, y_m, last.pose.heading_rad + turned_rad)
        self.latest = OdometryReading(pose, stamp_s, arrival_s)
        # The larger time of both clocks: a late message is not a jump, nor is a repeated stamp.
        elapsed_s = max(stamp_s - last.stamp_s, arrival_s - last.arrival_s, 0.0)
        moved_m = pose.distance_to(last.pose)
        if moved_m > _JUMP_FACTOR * self._max_linear_m_s * elapsed_s + _JUMP_MARGIN_M:
            return _jumped(f"{moved_m:.2f} m", elapsed_s)
        if abs(turned_rad) > _JUMP_FACTOR * self._max_angular_rad_s * elapsed_s + _JUMP_MARGIN_RAD:
            return _jumped(f"{math.degrees(turned_rad):.0f}°", elapsed_s)
        return None


def _jumped(far: str, elapsed_s: float) -> OdometryFault:
    return OdometryFault(f"odometry jumped {far} in {elapsed_s:.2f} s")


class ClockOffset:
    """Offset of another machine's clock, from the stamps and arrivals of its messages.

    Uses the smallest difference of the latest messages, whose transport was fastest.
    """

    def __init__(self) -> None:
        self._differences: deque[float] = deque(maxlen=200)
        self.offset_s = 0.0

    def add(self, stamp_s: float, arrival_s: float) -> None:
        """Add the stamp and arrival of a message."""
        self._differences.append(arrival_s - stamp_s)
        self.offset_s = min(self._differences)

    def to_local(self, stamp_s: float) -> float:
        """Return a stamp on the clock of this process."""
        return stamp_s + self.offset_s
