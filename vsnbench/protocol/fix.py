"""Where the robot stands in the site, and how that is known."""

from dataclasses import dataclass
from enum import StrEnum

from vsnbench.protocol.pose import Pose


class PoseSource(StrEnum):
    """How a robot's pose in the site is known; also how a distance to the goal was measured."""

    SIMULATED = "simulated"
    SURVEYED = "surveyed"
    MEASURED = "measured"
    """From depth images against the site's twin."""
    TAPE = "tape"
    ESTIMATED = "estimated"


@dataclass(frozen=True, slots=True)
class Fix:
    """The robot's pose in the site's frame and how it is known."""

    pose: Pose
    source: PoseSource
