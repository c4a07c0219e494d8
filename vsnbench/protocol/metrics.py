"""Metrics of navigation: success rate, progress, SPL, SoftSPL, SCT, path length, smoothness.

SPL: Anderson et al., "On Evaluation of Embodied Navigation Agents" (2018), Eq. 1. SoftSPL: Datta et al.,
"Integrating Egocentric Localization for More Realistic Point-Goal Navigation Agents" (2020), Section 4.
SCT: Yokoyama, Ha and Batra, "Success Weighted by Completion Time: A Dynamics-Aware Evaluation Criteria for Embodied
Navigation" (2021), Section III. The ideal time here is a lower bound that needs no model of the base's dynamics: the
shortest path at the base's greatest speed, without turns.
"""

import itertools
import math
from collections.abc import Iterable, Sequence

from vsnbench.values.pose import Pose, wrap_angle

TRIVIAL_M = 0.25
"""Length of one move (paper, Section 4.1); trials with a shorter shortest path do not measure navigation."""


def success_rate(successes: Iterable[bool]) -> float:
    """Return the share of successful episodes, 0 to 1; NaN for none (paper, Section 4.1)."""
    outcomes = list(successes)
    return sum(outcomes) / len(outcomes) if outcomes else math.nan


def spl(success: bool, shortest_m: float, path_m: float) -> float:
    """Return success weighted by path length of one episode, 0 to 1.

    Args:
        success: whether the episode succeeded.
        shortest_m: geodesic distance from the start to the success region.
        path_m: length of the robot's path.
    """
    return _path_efficiency(shortest_m, path_m) if success else 0.0


def progress(shortest_m: float, remaining_m: float) -> float:
    """Return how much of the shortest path to the goal was covered, 0 to 1.

    1 - remaining / shortest, and 0 if the robot ended farther away than it began. Without a way to go, 1 if there is
    still none. Progress is measured from poses, never from a verdict: an episode that reached the goal and did not stop
    has progress 1 and is a failure.

    Args:
        shortest_m: geodesic distance from the start to the success region.
        remaining_m: the same distance from the end of the episode.
    """
    if shortest_m <= 0:
        return 1.0 if remaining_m <= 0 else 0.0
    return min(1.0, max(0.0, 1.0 - remaining_m / shortest_m))


def known_progress(shortest_m: float | None, remaining_m: float | None) -> float | None:
    """Return `progress` of recorded lengths; None if a length is unknown or not finite."""
    if shortest_m is None or remaining_m is None or not (math.isfinite(shortest_m) and math.isfinite(remaining_m)):
        return None
    return progress(shortest_m, remaining_m)


def soft_spl(shortest_m: float, remaining_m: float, path_m: float) -> float:
    """Return SPL with progress instead of success, 0 to 1.

    Args:
        shortest_m: geodesic distance from the start to the success region.
        remaining_m: the same distance from the end of the episode.
        path_m: length of the robot's path.
    """
    return progress(shortest_m, remaining_m) * _path_efficiency(shortest_m, path_m)


def ideal_time_s(shortest_m: float, max_linear_m_s: float) -> float:
    """Return the time that no episode can undercut: the shortest path at the base's greatest speed."""
    return shortest_m / max_linear_m_s


def sct(success: bool, ideal_s: float, taken_s: float) -> float:
    """Return success weighted by completion time of one episode, 0 to 1.

    Args:
        success: whether the episode succeeded.
        ideal_s: see `ideal_time_s`.
        taken_s: time of the episode that counts towards a limit: driving on the robot's clock and, on a real robot,
            thinking.
    """
    longest = max(ideal_s, taken_s)
    return 0.0 if not success else 1.0 if longest <= 0 else ideal_s / longest


def _path_efficiency(shortest_m: float, path_m: float) -> float:
    longest = max(shortest_m, path_m)
    return 1.0 if longest <= 0 else shortest_m / longest


def path_length_m(poses: Sequence[Pose]) -> float:
    """Return the length of the polyline through the positions, metres."""
    return sum(before.distance_to(after) for before, after in itertools.pairwise(poses))


def heading_change_deg_per_m(poses: Sequence[Pose], path_m: float) -> float | None:
    """Return the smoothness of a path: change of heading per metre, degrees; lower is smoother.

    Turns are added without their signs, each from one pose to the next the shorter way round.

    Args:
        poses: poses in order, one after each action.
        path_m: length of the path.

    Returns:
        The ratio; None for a path shorter than one move (`TRIVIAL_M`), which has no shape.
    """
    if path_m < TRIVIAL_M:
        return None
    turned = sum(abs(wrap_angle(b.heading_rad - a.heading_rad)) for a, b in itertools.pairwise(poses))
    return math.degrees(turned) / path_m
