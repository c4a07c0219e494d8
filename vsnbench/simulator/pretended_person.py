"""A person who puts a robot at marks on the floor, played: near and not at them, and nearer when asked again."""

import math
from collections.abc import Callable

import numpy as np

from vsnbench.protocol.pose import Pose

_CARRIED_M, _CARRIED_RAD = 0.12, math.radians(7.0)
"""Standard deviations along x, along y and in heading, of a robot that was wheeled to its mark."""
_FARTHEST_M, _FARTHEST_RAD = 0.35, math.radians(20.0)
_LEFT_OVER = 0.15
"""Share of an offset that is still there after it was mended by eye ..."""
_NUDGED_M, _NUDGED_RAD = 0.01, math.radians(0.6)
"""... and the standard deviations of what comes on top."""
_AT_THE_MARK_M = 0.6
_ATTEMPTS = 60


class PretendedPerson:
    """Remembers what was asked, so that the same questions find the same answers."""

    def __init__(self) -> None:
        self._asked: dict[tuple[Pose, int], int] = {}

    def put_down(self, mark: Pose, stands: Pose, seed: int, touches: Callable[[Pose], str]) -> Pose:
        """Return where the robot stands after it was put at the mark, or mended where it stands there already.

        Args:
            mark: where it should stand.
            stands: where it stands now.
            seed: of the person's errors.
            touches: what the robot would touch at a pose; empty for nothing.
        """
        count = self._asked[mark, seed] = self._asked.get((mark, seed), 0) + 1
        rng = np.random.default_rng([abs(seed), count])
        now = stands.relative_to(mark)
        turn_rad = math.remainder(now.heading_rad, math.tau)
        mended = count > 1 and mark.distance_to(stands) < _AT_THE_MARK_M
        for attempt in range(_ATTEMPTS):
            calmer = 1 - attempt / _ATTEMPTS
            if mended:
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
