"""Where a robot may stand, roughly: every pose of a grid about the mark, by how well its view fits what was seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsnbench.placement.looks import Sighting
from vsnbench.protocol.pose import Pose

REACH_M, REACH_DEG = 0.45, 30.0
"""How far from its mark a robot is looked for."""
_STEP_M, _STEP_DEG = 0.15, 5.0
CUT = 0.15
"""Residuals of the logarithm of depth are cut here: what differs by more just differs."""
_POLISH, _POLISH_ROUNDS = ((0.08, 2.5), (0.04, 1.25)), 3
"""Steps to the neighbours, metres and degrees, and how many of each at most."""
_CHANGED = 0.5
"""What a pixel costs, where 1 is seeing through a wall, at which something has come or gone: rooms change."""
_BESIDE_M = (-0.3, -0.2, 0.2, 0.3)
_LEAST_FILLED, _SAME_WAY_RAD, _UPRIGHT = 0.05, math.radians(3), 0.5
"""Surfaces of one direction, in such steps, that fill less of the view do not count; nor do those that lie."""
_APART_M, _APART_RAD = 0.22, math.radians(8.0)
"""Two places nearer than both are one basin."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A pose of the first look, and how badly it fits: 0 perfect, 1 nowhere."""

    pose: Pose
    misfit: float


def misfit_of(sighting: Sighting, poses: Sequence[Pose], scale: float = 1.0) -> float:
    """Return how badly the views from `poses` fit the looks: the mean of the cut residuals, as a share of the cut.

    To see through the building is impossible, and costs all; to see nearer than expected, or through an object, costs
    less, for things come and go.
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


def candidates(sighting: Sighting, mark: Pose, most: int) -> tuple[Candidate, ...]:
    """Return the best basins about the mark, best first.

    Args:
        sighting: small.
        mark: the middle of the search.
        most: how many basins.
    """
    steps = np.arange(-REACH_M, REACH_M + 1e-9, _STEP_M)
    turns = np.radians(np.arange(-REACH_DEG, REACH_DEG + 1e-9, _STEP_DEG))
    tried = [
        _tried(sighting, mark.compose(Pose(float(ahead), float(left), float(turn))))
        for ahead in steps
        for left in steps
        if math.hypot(ahead, left) <= REACH_M * 1.2
        for turn in turns
    ]
    tried.sort(key=lambda candidate: candidate.misfit)
    basins: list[Candidate] = []
    for one in tried:
        if all(not near(one.pose, other.pose) for other in basins):
            basins.append(one)
            if len(basins) == most:
                break
    return tuple(basins)


def polished(sighting: Sighting, one: Candidate) -> Candidate:
    """Return where its neighbours, and theirs, fit best: unlike a fit of surfaces, what was moved does not draw it."""
    for step_m, step_deg in _POLISH:
        turn_rad = math.radians(step_deg)
        ways = [Pose(step_m, 0.0), Pose(-step_m, 0.0), Pose(0.0, step_m), Pose(0.0, -step_m)]
        ways += [Pose(0.0, 0.0, turn_rad), Pose(0.0, 0.0, -turn_rad)]
        for _ in range(_POLISH_ROUNDS):
            tried = [_tried(sighting, one.pose.compose(way)) for way in ways]
            best = min(tried, key=lambda each: each.misfit)
            if best.misfit >= one.misfit:
                break
            one = best
    return one


def along_surfaces(sighting: Sighting, one: Candidate, scale: float) -> tuple[Candidate, ...]:
    """Return the places beside one, along each upright surface in view, with the same heading.

    A surface looks the same from all along it, so where a fit may be far off with nothing to show it is along one. What
    then speaks against it is a few pixels, of a corner or of an object, that the fit of surfaces takes for sure.

    Args:
        sighting: small.
        one: where.
        scale: what depth is to be multiplied with.
    """
    ways = round(math.pi / _SAME_WAY_RAD)
    filled = np.zeros(ways)
    for look in sighting.looks:
        face = sighting.expected(look, one.pose.compose(look.odometry)).face
        normal = sighting.twin.normals[face[face >= 0]]
        normal = normal[np.abs(normal[:, 2]) < _UPRIGHT]
        along_rad = np.arctan2(normal[:, 0], -normal[:, 1])
        filled += np.bincount(np.rint(along_rad / _SAME_WAY_RAD).astype(int) % ways, minlength=ways) / face.size
    places = [
        Pose(
            one.pose.x_m + step_m * math.cos(way * _SAME_WAY_RAD),
            one.pose.y_m + step_m * math.sin(way * _SAME_WAY_RAD),
            one.pose.heading_rad,
        )
        for way in np.nonzero(filled >= _LEAST_FILLED * len(sighting.looks))[0].tolist()
        for step_m in _BESIDE_M
    ]
    return tuple(_tried(sighting, pose, scale) for pose in places)


def _tried(sighting: Sighting, pose: Pose, scale: float = 1.0) -> Candidate:
    """Return how badly a pose of the first look fits, each other one being where odometry has it from there."""
    return Candidate(pose, misfit_of(sighting, [pose.compose(look.odometry) for look in sighting.looks], scale))


def near(one: Pose, other: Pose, share: float = 1.0) -> bool:
    """Whether two poses are of one basin, or nearer than that by `share`."""
    turned_rad = abs(math.remainder(one.heading_rad - other.heading_rad, math.tau))
    return one.distance_to(other) < share * _APART_M and turned_rad < share * _APART_RAD
