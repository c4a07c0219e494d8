"""The numbers of a report: success rate, SPL, SoftSPL, distance to the goal, path length.

SPL: Anderson et al., "On Evaluation of Embodied Navigation Agents" (2018), Eq. 1. SoftSPL: Datta et al.,
"Integrating Egocentric Localization for More Realistic Point-Goal Navigation Agents" (2020), Section 4.
"""

import itertools
import math
from collections.abc import Iterable, Sequence

from vsnbench.protocol.pose import Pose

TRIVIAL_M = 0.25
"""One move (paper, Section 4.1): a trial whose shortest path is below it tells nothing about navigation."""


def success_rate(successes: Iterable[bool]) -> float:
    """Return the share of successful episodes, 0 to 1; NaN for none (paper, Section 4.1)."""
    outcomes = list(successes)
    return sum(outcomes) / len(outcomes) if outcomes else math.nan


def spl(success: bool, shortest_m: float, path_m: float) -> float:
    """Return success weighted by path length of one episode, 0 to 1.

    Args:
        success: whether the episode succeeded.
        shortest_m: geodesic distance from the start to where the goal counts as reached.
        path_m: length of the path that was driven.
    """
    return _path_efficiency(shortest_m, path_m) if success else 0.0


def soft_spl(shortest_m: float, remaining_m: float, path_m: float) -> float:
    """Return SPL with progress in place of success, 0 to 1.

    Args:
        shortest_m: geodesic distance from the start to where the goal counts as reached.
        remaining_m: the same distance from where the episode ended.
        path_m: length of the path that was driven.
    """
    if shortest_m <= 0:
        progress = 1.0 if remaining_m <= 0 else 0.0
    else:
        progress = min(1.0, max(0.0, 1.0 - remaining_m / shortest_m))
    return progress * _path_efficiency(shortest_m, path_m)


def _path_efficiency(shortest_m: float, path_m: float) -> float:
    longest = max(shortest_m, path_m)
    return 1.0 if longest <= 0 else shortest_m / longest


def path_length_m(poses: Sequence[Pose]) -> float:
    """Return the length of the polyline through the positions, metres."""
    return sum(before.distance_to(after) for before, after in itertools.pairwise(poses))
