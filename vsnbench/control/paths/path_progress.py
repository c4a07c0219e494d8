"""A polyline that a robot follows, and how far along it the robot is."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from itertools import accumulate, pairwise

from vsnbench.control.law import turn_error_rad
from vsnbench.values.pose import Pose

LOOK_AHEAD_M = 0.20
"""Distance along the path of the point that is pursued."""
_LEAST_LOOK_AHEAD_M = 0.08
_BEND_RAD = 0.35
"""A path that bends more than this within the look-ahead is pursued from nearer, or its bends would be cut."""
_STEP_M = 0.02


class PathProgress:
    """Progress along a path of at least two points.

    Args:
        path: points in the frame of the odometry.

    Attributes:
        progress_m: length of the path behind the robot.
    """

    def __init__(self, path: Sequence[tuple[float, float]]) -> None:
        self._path = path
        self._at_m = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(path))]
        self.length_m = self._at_m[-1]
        self.progress_m = 0.0

    @property
    def remaining_m(self) -> float:
        """Length of the path that is left."""
        return max(self.length_m - self.progress_m, 0.0)

    def join(self, pose: Pose) -> None:
        """Begin at the point of the whole path that is nearest to the robot."""
        count = math.ceil(self.length_m / _STEP_M)
        ways_m = [self.length_m * k / count for k in range(count + 1)] if count else [0.0]
        self.progress_m = min(ways_m, key=lambda at_m: math.dist(self._point_at(at_m), pose.position))

    def pursued(self) -> tuple[float, float]:
        """Return the point to pursue: nearer in a sharp bend, and towards the end."""
        return self._point_at(self.progress_m + self._look_ahead_m())

    def advance(self, pose: Pose) -> float:
        """Advance to the nearest point of the path not far ahead; return the distance to it."""
        best_m, best_at_m = math.inf, self.progress_m
        at_m = self.progress_m
        while at_m <= min(self.progress_m + 1.5 * LOOK_AHEAD_M, self.length_m):
            x_m, y_m = self._point_at(at_m)
            away_m = math.hypot(x_m - pose.x_m, y_m - pose.y_m)
            if away_m < best_m:
                best_m, best_at_m = away_m, at_m
            at_m += _STEP_M / 2
        self.progress_m = best_at_m
        end_x_m, end_y_m = self._path[-1]
        if self.remaining_m < LOOK_AHEAD_M:  # near the end, what counts is the distance ahead along the last segment
            before_x_m, before_y_m = self._path[-2]
            direction_rad = math.atan2(end_y_m - before_y_m, end_x_m - before_x_m)
            ahead_m = (end_x_m - pose.x_m) * math.cos(direction_rad) + (end_y_m - pose.y_m) * math.sin(direction_rad)
            self.progress_m = max(self.progress_m, self.length_m - max(ahead_m, 0.0))
        return best_m

    def _look_ahead_m(self) -> float:
        """Return the distance of the point to pursue: shorter in a sharp bend, and towards the end."""
        ahead_m = min(LOOK_AHEAD_M, max(self.remaining_m, _LEAST_LOOK_AHEAD_M))
        bend_rad = abs(
            turn_error_rad(self._direction_rad(self.progress_m + ahead_m), self._direction_rad(self.progress_m))
        )
        return max(_LEAST_LOOK_AHEAD_M, ahead_m * min(1.0, _BEND_RAD / max(bend_rad, 1e-9)))

    def _direction_rad(self, at_m: float) -> float:
        (ax, ay), (bx, by) = self._point_at(at_m), self._point_at(at_m + _STEP_M)
        return math.atan2(by - ay, bx - ax)

    def _point_at(self, at_m: float) -> tuple[float, float]:
        """Return the point at a length of the path; beyond its end, on the extension of the last segment."""
        k = min(max(bisect_left(self._at_m, at_m) - 1, 0), len(self._path) - 2)
        (ax, ay), (bx, by) = self._path[k], self._path[k + 1]
        span_m = self._at_m[k + 1] - self._at_m[k]
        share = (at_m - self._at_m[k]) / span_m if span_m > 0 else 0.0
        return ax + share * (bx - ax), ay + share * (by - ay)
