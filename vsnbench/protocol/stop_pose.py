"""Where a real robot stopped: its distance to the goal by the odometry and by depth images, and which one is judged."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from vsnbench.protocol.judge import GoalDistance, distance_to_goal
from vsnbench.text.distances import distance_text
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.placement import FLOOR_REGION, MeasuredPlacement, PoseCovariance
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    from vsnbench.protocol.parameters import ProtocolParameters
    from vsnbench.sites.site import Site

_RIM = 16
"""Number of poses on the rim of a 95 % region whose distances bound the distance."""


@dataclass(frozen=True, slots=True)
class StopPose:
    """A robot's pose after STOP: measured from depth images, near where the odometry expects it."""

    placement: MeasuredPlacement
    """The measurement; its `mark` is the pose by the odometry."""
    odometry: GoalDistance
    """Distance from the pose by the odometry, with its range."""
    measured: GoalDistance | None
    """Distance from the measured pose, with its range; None if the images do not determine the pose."""
    success_distance_m: float
    """Success distance of the protocol."""

    @property
    def judged(self) -> GoalDistance:
        """The distance that the protocol proposes: the measured one if there is one."""
        return self.odometry if self.measured is None else self.measured

    @property
    def fix(self) -> Fix:
        """The pose that belongs to `judged`."""
        if self.measured is None:
            return Fix(self.placement.mark, self.odometry.source)
        return Fix(self.placement.pose, self.measured.source)

    @property
    def verdicts_differ(self) -> bool:
        """Whether STOP succeeds by one pose and fails by the other."""
        within_m = self.success_distance_m
        return self.measured is not None and self.measured.is_under(within_m) != self.odometry.is_under(within_m)

    @property
    def text(self) -> str:
        """Both distances with their ranges in one line."""
        measured = f"not measured ({self.unknown})"
        if self.measured is not None:
            measured = f"measured {range_text(self.measured, self.success_distance_m)}"
        contradiction = ": they give different verdicts" if self.verdicts_differ else ""
        return f"{measured}, odometry {range_text(self.odometry, self.success_distance_m)}{contradiction}"

    @property
    def unknown(self) -> str:
        """Why the images do not determine the pose; empty if they do."""
        if not self.placement.fits:
            return "the view matches no pose near the odometry's"
        return f"the view does not determine {' and '.join(self.placement.undetermined)}" if not self.measured else ""


def stop_pose(
    site: "Site", goal: str, parameters: "ProtocolParameters", placement: MeasuredPlacement, expected: PoseCovariance
) -> StopPose:
    """Return what a measurement after STOP says about the distance to the goal.

    Args:
        site: the site.
        goal: goal of the episode.
        parameters: the protocol's parameters.
        placement: measurement whose `mark` is the pose by the odometry.
        expected: covariance of the pose by the odometry in the site's frame.
    """

    def ranged(pose: Pose, covariance: PoseCovariance, source: PoseSource) -> GoalDistance:
        distance = distance_to_goal(site, goal, Fix(pose, source), parameters)
        values, axes = np.linalg.eigh(covariance.matrix[:2, :2])
        half_axes = axes * np.sqrt(FLOOR_REGION * np.maximum(values, 0.0))
        angles = np.linspace(0.0, math.tau, _RIM, endpoint=False)
        rim = [distance.distance_m]
        for x_m, y_m in (half_axes @ np.array([np.cos(angles), np.sin(angles)])).T.tolist():
            there = Pose(pose.x_m + x_m, pose.y_m + y_m, pose.heading_rad)
            other = distance_to_goal(site, goal, Fix(there, source), parameters)
            rim.append(other.distance_m if other.in_sight == distance.in_sight else math.inf)
        return replace(distance, range_m=(min(rim), max(rim)))

    odometry = ranged(placement.mark, expected, PoseSource.ESTIMATED)
    measured = ranged(placement.pose, placement.covariance, PoseSource.MEASURED) if placement.determined else None
    return StopPose(placement, odometry, measured, parameters.success_distance_m)


def range_text(distance: GoalDistance, success_distance_m: float) -> str:
    """Return a distance with its 95 % range, rounded to its side of the success distance."""
    text = f"{distance_text(distance.distance_m, success_distance_m)} m"
    if distance.range_m is None:
        return text
    low_m, high_m = distance.range_m
    return f"{text} ({low_m:.2f} to {high_m:.2f})" if math.isfinite(high_m) else f"{text} ({low_m:.2f} or more)"
