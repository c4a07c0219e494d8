"""Velocity commands, and the base class of the controllers that compute them."""

import math
from abc import ABC, abstractmethod
from enum import StrEnum
from typing import NamedTuple

from vsnbench.values.pose import Pose


class MotionStatus(StrEnum):
    """State of a motion."""

    MOVING = "moving"
    DONE = "done"
    FAILED = "failed"


class Command(NamedTuple):
    """Velocity of the base: forward, counter-clockwise, and to the left for a base that can move sideways.

    A tuple for speed: every period makes one.
    """

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    lateral_m_s: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """Speed over the floor, not negative."""
        return math.hypot(self.linear_m_s, self.lateral_m_s) if self.lateral_m_s else abs(self.linear_m_s)

    @property
    def turned_left(self) -> "Command":
        """The command to a base of a velocity in the frame of a robot that faces to the left of it."""
        return Command(-self.lateral_m_s, self.angular_rad_s, self.linear_m_s)


STANDSTILL = Command()


class Controller(ABC):
    """Steers one motion from rest to rest; it has no clock and no robot."""

    def __init__(self) -> None:
        self.status = MotionStatus.MOVING
        self.failure = ""
        """Reason why the motion failed."""
        self.sensor_lost = False
        self.corrections = 0
        self.duration_s = 0.0

    @property
    def done(self) -> bool:
        """Whether the motion ended within its tolerance."""
        return self.status is MotionStatus.DONE

    @property
    def rest_since_s(self) -> float:
        """Time since when the base has been at rest, if noisy readings were averaged; infinity otherwise."""
        return math.inf

    @property
    def remaining_m(self) -> float:
        """Distance that is left to drive; infinity if it is not known, 0 for a turn."""
        return math.inf

    def abort(self, reason: str) -> Command:
        """End the motion as failed for a reason from the caller; returns the standstill command."""
        if self.status is MotionStatus.MOVING:
            self.status = MotionStatus.FAILED
            self.failure = reason
        return STANDSTILL

    @abstractmethod
    def step(self, pose: Pose, now_s: float, stamp_s: float | None = None) -> Command:
        """Process the newest odometry and return the velocity to command from now on; see `MotionController`."""
