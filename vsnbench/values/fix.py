"""Pose of the robot in the site, with its source."""

from dataclasses import dataclass
from enum import StrEnum

from vsnbench.values.pose import Pose


class PoseSource(StrEnum):
    """Source of a robot's pose in the site, or of a distance to the goal."""

    SIMULATED = "simulated"
    SURVEYED = "surveyed"
    MEASURED = "measured"
    """From depth images matched with the site's twin."""
    TAPE = "tape"
    ESTIMATED = "estimated"


@dataclass(frozen=True, slots=True)
class Fix:
    """Pose of the robot in the site's frame, with its source."""

    pose: Pose
    source: PoseSource
