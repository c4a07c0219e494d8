"""Whether a movement does what was asked, by the odometry alone: while it runs, and after it was answered True."""

import math
from dataclasses import dataclass
from typing import Self

from vsnbench.motion.law import direction
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.pose import Pose

MOST_OFF_M, MOST_OFF_RAD = 0.10, math.radians(10)
"""A movement that is off by more than this is not what was asked. Upstream's own tolerance of 0.08 rad, and its
overshoot on a base with a lag, stay well below."""


class MovementAlarmError(Exception):
    """Something happened during a movement that must end it at once."""

    def __init__(self, reason: str, *, sensor_lost: bool = False) -> None:
        super().__init__(reason)
        self.sensor_lost = sensor_lost


@dataclass(frozen=True, slots=True)
class AskedMovement:
    """One movement as it was asked for; signed: backwards and to the right are negative."""

    distance_m: float = 0.0
    angle_rad: float = 0.0

    @classmethod
    def of(cls, action: Action, settings: MotionSettings) -> Self:
        """Return what an action asks for."""
        way = settings.way(action) * direction(action)
        return cls(angle_rad=way) if action.turns else cls(distance_m=way)

    def overshoot(self, before: Pose, now: Pose) -> str:
        """Return in words how far a movement under way has left what was asked; empty while it has not.

        Args:
            before: odometry when the movement was asked for.
            now: odometry now, its heading unwrapped against that.
        """
        moved_m, turned_rad = distance_along(before, now), now.heading_rad - before.heading_rad
        if _outside(moved_m, self.distance_m, MOST_OFF_M):
            return f"the robot has moved {moved_m * 100:.1f} cm where {self.distance_m * 100:g} cm were asked"
        if _outside(turned_rad, self.angle_rad, MOST_OFF_RAD):
            turned_deg, asked_deg = math.degrees(turned_rad), math.degrees(self.angle_rad)
            return f"the robot has turned {turned_deg:.1f}° where {asked_deg:g}° were asked"
        return ""

    def contradiction(self, before: Pose, after: Pose) -> str:
        """Return in words how far the odometry contradicts an answer of True; empty when it does not."""
        moved_m, turned_rad = distance_along(before, after), after.heading_rad - before.heading_rad
        if abs(moved_m - self.distance_m) <= MOST_OFF_M and abs(turned_rad - self.angle_rad) <= MOST_OFF_RAD:
            return ""
        return (
            f"the odometry moved {moved_m * 100:.1f} cm and turned {math.degrees(turned_rad):.1f}° instead of "
            f"{self.distance_m * 100:g} cm and {math.degrees(self.angle_rad):g}°"
        )


def distance_along(before: Pose, after: Pose) -> float:
    """Return the distance between two poses in metres, negative where the second lies behind the first."""
    distance_m = before.distance_to(after)
    return distance_m if after.relative_to(before).x_m >= 0 else -distance_m


def _outside(now: float, asked: float, most_off: float) -> bool:
    return not min(asked, 0.0) - most_off <= now <= max(asked, 0.0) + most_off
