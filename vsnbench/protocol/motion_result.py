"""What became of one requested action."""

from dataclasses import dataclass
from enum import StrEnum

from vsnbench.protocol.pose import Pose


class CollisionSource(StrEnum):
    """Who says that the robot touched something."""

    CONTACT = "contact"
    """Contact in simulation."""
    BUMPER = "bumper"


@dataclass(frozen=True, slots=True)
class Collision:
    """A touch: who noticed it, and what was touched where that is known."""

    source: CollisionSource
    touched: str = ""


@dataclass(frozen=True, slots=True)
class MotionResult:
    """The measured outcome of an action; displacement and turn are the odometry's, signed."""

    completed: bool
    """The robot did what was asked within its tolerances."""
    displacement_m: float = 0.0
    turn_rad: float = 0.0
    duration_s: float = 0.0
    collision: Collision | None = None
    failure: str = ""
    """Why it did not complete, in words."""
    corrections: int = 0
    pose: Pose | None = None
    """Odometry after the motion, relative to the start of the episode."""
    sensor_lost: bool = False
    """The motion failed because of a sensor, which was silent or sent what cannot be used, not because of the base."""
