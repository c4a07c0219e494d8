"""Discrete movements by name, and the outcome of a movement."""

from dataclasses import dataclass

from vsnbench.values.action import Action

MOVEMENTS = {
    "Forward": Action.MOVE_FORWARD,
    "Backward": Action.MOVE_BACKWARD,
    "Left": Action.TURN_LEFT,
    "Right": Action.TURN_RIGHT,
    "Stop": Action.STOP,
}
"""Actions by the names of the service (paper, Section 3.1.3)."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a movement."""

    movement: str
    answer: bool
    """Answer of the service."""
    reason: str = ""
    """Why the answer is False."""
    corrections: int = 0
    duration_s: float = 0.0
    sensor_lost: bool = False
