"""Errors of an odometry while it drives: of distances, of turns, and a curve to one side.

A wheel that is larger than assumed or that slips makes every distance wrong by the same share, unequal wheels make
every straight way a curve, and a wrong track or skidding makes every turn wrong by the same share (systematic errors of
differential drives: Borenstein and Feng, 1996).
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.values.placement import PoseCovariance
from vsnbench.values.pose import Pose, advanced

_TINY = 1e-5
"""Step of the numeric derivatives."""


@dataclass(frozen=True, slots=True)
class OdometryErrors:
    """Values of the three errors, or their standard deviations."""

    way: float = 0.0
    """True distance per measured distance, minus 1."""
    turn: float = 0.0
    """True turn per measured turn, minus 1."""
    veer_rad_per_m: float = 0.0
    """Turn to the left per metre forward that the odometry does not measure."""

    def driven(self, steps: Sequence[Pose]) -> Pose:
        """Return where a robot is after steps, in the frame of its pose before them.

        Args:
            steps: what the odometry measured of each step, in the frame of the pose before it.
        """
        here = Pose(0.0, 0.0)
        for step in steps:
            length_m = math.hypot(*step.position)
            veered_rad = self.veer_rad_per_m * math.copysign(length_m, step.x_m)
            # The step's chord is turned by half of what it veers.
            middle = advanced(here, 0.0, veered_rad / 2)
            turn_rad = step.heading_rad * (1 + self.turn) + veered_rad / 2
            here = middle.compose(Pose(step.x_m * (1 + self.way), step.y_m * (1 + self.way), turn_rad))
        return here

    def plus(self, other: "OdometryErrors") -> "OdometryErrors":
        """Return the sums."""
        return OdometryErrors(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


UNITS = (OdometryErrors(way=1.0), OdometryErrors(turn=1.0), OdometryErrors(veer_rad_per_m=1.0))


def by_errors(steps: Sequence[Pose], errors: OdometryErrors, *, backward: bool = False) -> npt.NDArray[np.float64]:
    """Return the (3, 3) derivatives of x, y and heading after steps by the three errors, as columns.

    Args:
        steps: what the odometry measured of each step.
        errors: present values.
        backward: of the pose before the steps, in the frame of the pose after them.
    """
    columns = []
    for unit in UNITS:
        tiny = OdometryErrors(*(_TINY * value for value in astuple(unit)))
        here, there = (_end(steps, given, backward) for given in (errors, errors.plus(tiny)))
        columns.append([(there.x_m - here.x_m), (there.y_m - here.y_m), there.heading_rad - here.heading_rad])
    return np.array(columns).T / _TINY


def _end(steps: Sequence[Pose], errors: OdometryErrors, backward: bool) -> Pose:
    end = errors.driven(steps)
    return Pose(0.0, 0.0).relative_to(end) if backward else end


def covariance_after(
    start: Pose, known: PoseCovariance, steps: Sequence[Pose], spread: OdometryErrors
) -> PoseCovariance:
    """Return the covariance, in the site's frame, of a pose that the odometry measured from a start.

    Args:
        start: pose at the start in the site's frame.
        known: covariance of the start in that frame.
        steps: what the odometry measured of each step since.
        spread: standard deviations of the odometry's errors.
    """
    end = start.compose(OdometryErrors().driven(steps))
    carried = np.eye(3)
    carried[:2, 2] = -(end.y_m - start.y_m), end.x_m - start.x_m
    cos, sin = math.cos(start.heading_rad), math.sin(start.heading_rad)
    turned = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    own = turned @ by_errors(steps, OdometryErrors()) * np.array(astuple(spread))
    return PoseCovariance.of(carried @ known.matrix @ carried.T + own @ own.T)
