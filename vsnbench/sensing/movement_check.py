"""Comparison of a movement with its request, by the odometry: while it runs, and after it was answered True."""

import math

from vsnbench.values.movement import Drive, Move
from vsnbench.values.pose import Pose, wrap_angle

MAX_ERROR_M, MAX_ERROR_RAD = 0.10, math.radians(10)
"""Largest accepted errors. Upstream's own tolerance of 0.08 rad, and its overshoot on a base with a lag, are well
below."""
MISS_FACTOR = 2.0
"""Distance from the end of a movement, in tolerances of the robot, beyond which an answer is contradicted."""
_MAX_MISS_M = 0.03
"""Largest accepted distance from the end of a movement with parameters, which only our own mover executes: `MISSED_M`,
the noise of a reading, and what a base rolls after the answer.
"""


class MovementAlarmError(Exception):
    """A movement has to end at once."""

    def __init__(self, reason: str, *, sensor_lost: bool = False, blocked: bool = False) -> None:
        super().__init__(reason)
        self.sensor_lost = sensor_lost
        self.blocked = blocked
        """The way ahead is not free: the movement failed, the base did not."""


def overshoot(movement: Drive, before: Pose, now: Pose) -> str:
    """Return how far a running movement has left its request, or an empty string.

    Args:
        movement: the request.
        before: odometry at the request.
        now: current odometry, its heading unwrapped against `before`.
    """
    if isinstance(movement, Move) and movement.holds_heading:
        moved_m, turned_rad = distance_along(before, now), now.heading_rad - before.heading_rad
        if _outside(moved_m, movement.distance_m, MAX_ERROR_M):
            return f"the robot has moved {moved_m * 100:.1f} cm where {movement.distance_m * 100:g} cm were requested"
        if _outside(turned_rad, movement.turn_rad, MAX_ERROR_RAD):
            turned_deg, turn_deg = math.degrees(turned_rad), math.degrees(movement.turn_rad)
            return f"the robot has turned {turned_deg:.1f}° where {turn_deg:g}° were requested"
        return ""
    farthest_m, moved_m = movement.reach_m, before.distance_to(now)
    if moved_m > farthest_m + MAX_ERROR_M:
        return f"the robot is {moved_m:.2f} m from where the movement began, which reaches {farthest_m:.2f} m"
    return ""


def contradiction(movement: Drive, before: Pose, after: Pose, miss_m: float | None = None) -> str:
    """Return how the odometry contradicts that a movement is done, or an empty string.

    Args:
        movement: the request.
        before: odometry at the request.
        after: odometry at rest.
        miss_m: accepted distance from the end of a movement with parameters, if it is larger than that of a base with
            the paper's tolerances: `MISS_FACTOR` times the tolerance of the robot.
    """
    if isinstance(movement, Move) and movement.holds_heading:
        moved_m, turned_rad = distance_along(before, after), after.heading_rad - before.heading_rad
        error_m, error_rad = abs(moved_m - movement.distance_m), abs(turned_rad - movement.turn_rad)
        if error_m <= MAX_ERROR_M and error_rad <= MAX_ERROR_RAD:
            return ""
        return (
            f"the odometry moved {moved_m * 100:.1f} cm and turned {math.degrees(turned_rad):.1f}° instead of "
            f"{movement.distance_m * 100:g} cm and {math.degrees(movement.turn_rad):g}°"
        )
    target = movement.end
    if target is None:
        return overshoot(movement, before, after)
    wanted = before.compose(target)
    if (off_m := wanted.distance_to(after)) > max(_MAX_MISS_M, miss_m or 0.0):
        return f"the odometry is {off_m * 100:.1f} cm from the requested position"
    if movement.fixes_heading:
        off_rad = abs(wrap_angle(wanted.heading_rad - after.heading_rad))
        if off_rad > MAX_ERROR_RAD:
            return f"the odometry is {math.degrees(off_rad):.1f}° from the requested heading"
    return ""


def remaining_m(movement: Drive, before: Pose, now: Pose) -> float:
    """Return the distance that is left to the end; infinity if the way is not straight."""
    target = movement.end
    if target is None:
        return max(movement.reach_m - before.distance_to(now), 0.0)
    if not movement.is_straight:
        return math.inf
    return before.compose(target).distance_to(now)


def distance_along(before: Pose, after: Pose) -> float:
    """Return the distance between two poses in metres, negative if the second lies behind the first."""
    distance_m = before.distance_to(after)
    return distance_m if after.relative_to(before).x_m >= 0 else -distance_m


def displacement_m(movement: Drive, before: Pose, after: Pose) -> float:
    """Return the distance between two poses in metres, negative if the robot drove backwards."""
    if movement.holds_heading:
        return distance_along(before, after)
    return -before.distance_to(after) if movement.ahead < 0 else before.distance_to(after)


def _outside(value: float, requested: float, tolerance: float) -> bool:
    return not min(requested, 0.0) - tolerance <= value <= max(requested, 0.0) + tolerance
