"""Simulated operator who places a robot at marks, with errors that decrease with each correction."""

import math
from collections.abc import Callable

import numpy as np

from vsnbench.values.pose import Pose

_CARRIED_M, _CARRIED_RAD = 0.12, math.radians(7.0)
"""Standard deviations along x, along y and in heading after the robot was moved to a mark."""
_FARTHEST_M, _FARTHEST_RAD = 0.35, math.radians(20.0)
_LEFT_OVER = 0.15
"""Share of an offset that remains after a correction by eye."""
_NUDGED_M, _NUDGED_RAD = 0.01, math.radians(0.6)
"""Standard deviations of the error that a correction adds."""
_AT_THE_MARK_M = 0.6
_ATTEMPTS = 60


class SimulatedOperator:
    """Places robots at marks; repeats the same errors for the same sequence of requests."""

    def __init__(self) -> None:
        self._asked: dict[tuple[Pose, int], int] = {}

    def put_down(self, mark: Pose, robot: Pose, seed: int, touches: Callable[[Pose], str]) -> Pose:
        """Return the pose of the robot after a placement, or after a correction if it is at the mark already.

        Args:
            mark: pose of the mark.
            robot: present pose of the robot.
            seed: seed of the operator's errors.
            touches: returns what the robot would touch at a pose, or an empty string.
        """
        count = self._asked[mark, seed] = self._asked.get((mark, seed), 0) + 1
        rng = np.random.default_rng([abs(seed), count])
        now = robot.relative_to(mark)
        turn_rad = math.remainder(now.heading_rad, math.tau)
        is_correction = count > 1 and mark.distance_to(robot) < _AT_THE_MARK_M
        for attempt in range(_ATTEMPTS):
            calmer = 1 - attempt / _ATTEMPTS
            if is_correction:
                ahead, left = rng.normal((_LEFT_OVER * now.x_m, _LEFT_OVER * now.y_m), _NUDGED_M * calmer)
                turn = float(rng.normal(_LEFT_OVER * turn_rad, _NUDGED_RAD * calmer))
            else:
                ahead, left = rng.normal(0.0, _CARRIED_M * calmer, 2)
                turn = float(rng.normal(0.0, _CARRIED_RAD))
            share = min(1.0, _FARTHEST_M / max(math.hypot(ahead, left), 1e-9))
            turn = max(-_FARTHEST_RAD, min(_FARTHEST_RAD, turn))
            there = mark.compose(Pose(float(ahead) * share, float(left) * share, turn))
            if not touches(there):
                return there
        return mark
