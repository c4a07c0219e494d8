"""Result of one action."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from vsnbench.values.pose import Pose


class CollisionSource(StrEnum):
    """Source of a collision report."""

    CONTACT = "contact"
    """Contact in simulation."""
    BUMPER = "bumper"


@dataclass(frozen=True, slots=True)
class Collision:
    """A collision: its source, and the touched object if known."""

    source: CollisionSource
    touched: str = ""


@dataclass(frozen=True, slots=True)
class MotionResult:
    """Measured result of an action by the odometry; a displacement backwards and a turn to the right are negative."""

    completed: bool
    """Whether the robot completed the action within its tolerances."""
    displacement_m: float = 0.0
    turn_rad: float = 0.0
    duration_s: float = 0.0
    collision: Collision | None = None
    failure: str = ""
    """Reason why it did not complete, or an empty string."""
    corrections: int = 0
    pose: Pose | None = None
    """Odometry after the motion, relative to the start of the episode."""
    path_m: float | None = None
    """Length of the driven path by odometry, where it is not a straight line; None: `displacement_m` is its length."""
    blocked: str = ""
    """Why the guard ended the movement before its end, or an empty string; such a movement is not completed."""
    sensor_lost: bool = False
    """Whether the motion failed because of a sensor with missing or invalid data, not because of the base."""
    waiting_s: float | None = None
    """In continuous execution, time at rest without a path, waiting for an answer; None otherwise."""

    def followed_by(self, later: "MotionResult") -> "MotionResult":
        """Return one result for two parts of a continuous motion; it is completed if both are."""
        return replace(
            later,
            completed=self.completed and later.completed,
            displacement_m=self.displacement_m + later.displacement_m,
            turn_rad=self.turn_rad + later.turn_rad,
            duration_s=self.duration_s + later.duration_s,
            collision=self.collision or later.collision,
            failure=self.failure or later.failure,
            corrections=self.corrections + later.corrections,
            pose=later.pose or self.pose,
            path_m=(self.path_m or 0.0) + (later.path_m or 0.0),
            blocked=self.blocked or later.blocked,
            sensor_lost=self.sensor_lost or later.sensor_lost,
            waiting_s=(self.waiting_s or 0.0) + (later.waiting_s or 0.0),
        )


NOT_BEGUN: Final = MotionResult(completed=False)
"""Of a motion that a request to stop ended before it began."""
