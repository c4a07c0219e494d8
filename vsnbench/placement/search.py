"""Where a robot may stand, roughly: every pose of a grid about the mark, by how well its view fits what was seen."""

import math
from dataclasses import dataclass

import numpy as np

from vsnbench.placement.looks import SmallLook
from vsnbench.placement.twin import Twin
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose
from vsnbench.simulator.renderer import eye_of

REACH_M, REACH_DEG = 0.45, 30.0
"""How far from its mark a robot is looked for."""
_STEP_M, _STEP_DEG = 0.15, 5.0
CUT = 0.15
"""Residuals of the logarithm of depth are cut here: what differs by more just differs."""
_APART_M, _APART_RAD = 0.22, math.radians(8.0)
"""Two places nearer than both are one basin."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A pose of the first look, and how badly it fits: 0 perfect, 1 nowhere."""

    pose: Pose
    misfit: float


def misfit_of(twin: Twin, camera: Camera, looks: list[SmallLook], pose: Pose) -> float:
    """Return how badly the views from there fit the looks: the mean of the cut residuals, as a share of the cut."""
    total, pixels = 0.0, 0
    for look in looks:
        drawn = twin.drawer.draw(eye_of(camera, pose.compose(look.odometry)), look.pinhole).depth_m
        seen = np.isfinite(look.depth_m)
        with np.errstate(invalid="ignore", divide="ignore"):
            residual = np.abs(np.log(look.depth_m[seen] / drawn[seen]))
        total += float(np.minimum(np.nan_to_num(residual, nan=CUT), CUT).sum())
        pixels += int(seen.sum())
    return total / (CUT * pixels) if pixels else 1.0


def candidates(twin: Twin, camera: Camera, looks: list[SmallLook], mark: Pose, most: int) -> list[Candidate]:
    """Return the best basins about the mark, best first.

    Args:
        twin: what should be seen.
        camera: the robot's.
        looks: what was seen, small; the first is the one whose pose is sought.
        mark: the middle of the search.
        most: how many basins.
    """
    steps = np.arange(-REACH_M, REACH_M + 1e-9, _STEP_M)
    turns = np.radians(np.arange(-REACH_DEG, REACH_DEG + 1e-9, _STEP_DEG))
    tried = [
        Candidate(pose, misfit_of(twin, camera, looks, pose))
        for ahead in steps
        for left in steps
        if math.hypot(ahead, left) <= REACH_M * 1.2
        for turn in turns
        for pose in [mark.compose(Pose(float(ahead), float(left), float(turn)))]
    ]
    tried.sort(key=lambda candidate: candidate.misfit)
    basins: list[Candidate] = []
    for one in tried:
        if all(not near(one.pose, other.pose) for other in basins):
            basins.append(one)
            if len(basins) == most:
                break
    return basins


def near(one: Pose, other: Pose) -> bool:
    """Whether two poses are of one basin."""
    return (
        one.distance_to(other) < _APART_M
        and abs(math.remainder(one.heading_rad - other.heading_rad, math.tau)) < _APART_RAD
    )
