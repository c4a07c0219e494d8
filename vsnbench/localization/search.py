"""Coarse search: misfit of every pose on a grid around the mark."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsnbench.localization.looks import LookSet
from vsnbench.values.pose import Pose

_STEP_M, _STEP_DEG = 0.15, 5.0
CUT = 0.15
"""Limit of residuals of the logarithm of depth; larger differences count the same."""
_POLISH, _POLISH_ROUNDS = ((0.08, 2.5), (0.04, 1.25)), 3
"""Steps to neighbours, metres and degrees, and maximum number of each."""
_CHANGED = 0.5
"""Cost of a pixel at which an object has come or gone; seeing through a wall costs 1."""
_SHIFTS_M = (-0.3, -0.2, 0.2, 0.3)
_LEAST_FILLED, _DIRECTION_RAD, _UPRIGHT = 0.05, math.radians(3), 0.5
"""Minimum share of the view of a direction of surfaces, width of a direction, and maximum vertical component of
normals.
"""
_APART_M, _APART_RAD = 0.22, math.radians(8.0)
"""Poses nearer than both are in one basin."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Maximum distance from the expected pose in the search."""

    distance_m: float = 0.45
    heading_deg: float = 30.0

    def holds(self, pose: Pose, expected: Pose) -> bool:
        """Whether a fitted pose is within the reach, and a margin of the grid."""
        off = pose.relative_to(expected)
        turned_rad = abs(math.remainder(off.heading_rad, math.tau))
        return math.hypot(*off.position) < self.distance_m + 0.10 and turned_rad < math.radians(self.heading_deg + 4)


MARK_REACH = Reach()


@dataclass(frozen=True, slots=True)
class TriedPose:
    """A pose of the first look with its misfit: 0 perfect, 1 no match."""

    pose: Pose
    misfit: float


def misfit_of(sighting: LookSet, poses: Sequence[Pose], scale: float = 1.0) -> float:
    """Return the misfit of `poses`: the mean of the limited residuals, as a share of the limit.

    Depth behind the building is impossible and costs 1. Depth in front of the expected surface, or behind an object,
    costs less, because objects come and go.
    """
    total, pixels = 0.0, 0
    for look, pose in zip(sighting.looks, poses, strict=True):
        view = sighting.expected(look, pose)
        seen = np.isfinite(look.depth_m)
        with np.errstate(invalid="ignore", divide="ignore"):
            residual = np.log(scale * look.depth_m[seen] / view.depth_m[seen])
        residual = np.clip(np.nan_to_num(residual, nan=CUT), -CUT, CUT)
        solid = sighting.twin.object_of[view.face[seen]] == 0
        cost = np.abs(residual)
        cost[(residual < 0) | ~solid] *= _CHANGED
        total += float(cost.sum())
        pixels += len(cost)
    return total / (CUT * pixels) if pixels else 1.0


def candidates(sighting: LookSet, expected: Pose, most: int, reach: Reach) -> tuple[TriedPose, ...]:
    """Return the best basins around the expected pose, best first."""
    steps = np.arange(-reach.distance_m, reach.distance_m + 1e-9, _STEP_M)
    turns = np.radians(np.arange(-reach.heading_deg, reach.heading_deg + 1e-9, _STEP_DEG))
    tried = [
        _tried(sighting, expected.compose(Pose(float(ahead), float(left), float(turn))))
        for ahead in steps
        for left in steps
        if math.hypot(ahead, left) <= reach.distance_m * 1.2
        for turn in turns
    ]
    tried.sort(key=lambda candidate: candidate.misfit)
    basins: list[TriedPose] = []
    for candidate in tried:
        if all(not near(candidate.pose, other.pose) for other in basins):
            basins.append(candidate)
            if len(basins) == most:
                break
    return tuple(basins)


def polished(sighting: LookSet, candidate: TriedPose) -> TriedPose:
    """Return the best pose by a descent over neighbours; unlike a fit of surfaces, moved objects do not bias it."""
    for step_m, step_deg in _POLISH:
        turn_rad = math.radians(step_deg)
        ways = [Pose(step_m, 0.0), Pose(-step_m, 0.0), Pose(0.0, step_m), Pose(0.0, -step_m)]
        ways += [Pose(0.0, 0.0, turn_rad), Pose(0.0, 0.0, -turn_rad)]
        for _ in range(_POLISH_ROUNDS):
            tried = [_tried(sighting, candidate.pose.compose(way)) for way in ways]
            best = min(tried, key=lambda neighbour: neighbour.misfit)
            if best.misfit >= candidate.misfit:
                break
            candidate = best
    return candidate


def along_surfaces(sighting: LookSet, candidate: TriedPose, scale: float) -> tuple[TriedPose, ...]:
    """Return poses shifted along each upright surface in view, with the same heading.

    A surface looks the same along its whole length, so that a fit can be wrong along it without a residual. The
    evidence against a shift is a few pixels of a corner or an object, which the fit of surfaces does not question.
    """
    ways = round(math.pi / _DIRECTION_RAD)
    filled = np.zeros(ways)
    for look in sighting.looks:
        face = sighting.expected(look, candidate.pose.compose(look.odometry)).face
        normal = sighting.twin.normals[face[face >= 0]]
        normal = normal[np.abs(normal[:, 2]) < _UPRIGHT]
        along_rad = np.arctan2(normal[:, 0], -normal[:, 1])
        filled += np.bincount(np.rint(along_rad / _DIRECTION_RAD).astype(int) % ways, minlength=ways) / face.size
    places = [
        Pose(
            candidate.pose.x_m + step_m * math.cos(way * _DIRECTION_RAD),
            candidate.pose.y_m + step_m * math.sin(way * _DIRECTION_RAD),
            candidate.pose.heading_rad,
        )
        for way in np.nonzero(filled >= _LEAST_FILLED * len(sighting.looks))[0].tolist()
        for step_m in _SHIFTS_M
    ]
    return tuple(_tried(sighting, pose, scale) for pose in places)


def _tried(sighting: LookSet, pose: Pose, scale: float = 1.0) -> TriedPose:
    """Return the misfit of a pose of the first look; the poses of the others follow by odometry."""
    return TriedPose(pose, misfit_of(sighting, [pose.compose(look.odometry) for look in sighting.looks], scale))


def near(pose: Pose, other: Pose, share: float = 1.0) -> bool:
    """Whether two poses are in one basin, or within `share` of its size."""
    turned_rad = abs(math.remainder(pose.heading_rad - other.heading_rad, math.tau))
    return pose.distance_to(other) < share * _APART_M and turned_rad < share * _APART_RAD
