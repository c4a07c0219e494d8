"""A planned route that a robot follows without a stop: where it is along it, and which corner comes next."""

import math
from collections.abc import Sequence
from itertools import accumulate, pairwise

from vsnbench.values.pose import Pose

_STRAIGHT_RAD = math.radians(1)
_BEFORE_CORNER_M = 0.05
"""A corner nearer than this counts as reached."""


class Route:
    """A polyline with its corners.

    Args:
        poses: the planned poses from the robot's own on, in the site's frame.

    Attributes:
        poses: the same.
        left_m: length of the route that is left.
    """

    def __init__(self, poses: Sequence[Pose]) -> None:
        self.poses = tuple(poses)
        self._corners = _corners(self.poses)
        self._at_m = [0.0, *accumulate(a.distance_to(b) for a, b in pairwise(self._corners))]
        self._progress_m = 0.0
        self.left_m = self._at_m[-1]

    @property
    def end(self) -> Pose:
        """The pose at its end."""
        return self.poses[-1]

    def advance(self, here: Pose) -> float:
        """Take the robot's pose; return its distance from the route."""
        nearest_m, at_m = math.inf, self._progress_m
        for k, (a, b) in enumerate(pairwise(self._corners)):
            if self._at_m[k + 1] < self._progress_m:
                continue
            span_m = a.distance_to(b)
            along = (here.x_m - a.x_m) * (b.x_m - a.x_m) + (here.y_m - a.y_m) * (b.y_m - a.y_m)
            share = min(max(along / span_m**2, 0.0), 1.0)
            foot = Pose(a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m))
            away_m = here.distance_to(foot)
            if away_m < nearest_m - 1e-9:
                nearest_m, at_m = away_m, self._at_m[k] + share * span_m
        if len(self._corners) == 1:
            nearest_m = here.distance_to(self.end)
        self._progress_m = max(self._progress_m, at_m)
        self.left_m = self._at_m[-1] - self._progress_m
        return nearest_m

    def corner_after(self, ahead_m: float) -> tuple[Pose, bool]:
        """Return the first corner beyond a length ahead of the robot, and whether it is the end.

        The robot turns at a corner, and is therefore never expected beyond the next one.
        """
        upcoming = next((k for k, at_m in enumerate(self._at_m) if at_m > self._progress_m + _BEFORE_CORNER_M), None)
        last = len(self._corners) - 1
        if upcoming is None:
            return self.end, True
        if self._at_m[upcoming] <= self._progress_m + ahead_m + _BEFORE_CORNER_M:
            upcoming = min(upcoming + 1, last)
        return (self.end, True) if upcoming == last else (self._corners[upcoming], False)


def _corners(poses: Sequence[Pose]) -> list[Pose]:
    """Return the first and the last position, and those between where the direction changes."""
    moved = [poses[0]]
    for pose in poses[1:]:
        if pose.distance_to(moved[-1]) > 1e-6:
            moved.append(pose)
    corners = moved[:1]
    for before, here, after in zip(moved, moved[1:], moved[2:], strict=False):
        into_rad = math.atan2(here.y_m - before.y_m, here.x_m - before.x_m)
        out_rad = math.atan2(after.y_m - here.y_m, after.x_m - here.x_m)
        if abs(math.remainder(out_rad - into_rad, math.tau)) > _STRAIGHT_RAD:
            corners.append(here)
    return [*corners, moved[-1]] if len(moved) > 1 else corners
