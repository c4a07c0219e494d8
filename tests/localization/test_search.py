"""Alternative poses: any along a bare wall, none in a corner."""

import math

import numpy as np

from benchmarks.support.placement_trials import NoisyEye
from vsnbench.localization.looks import LookSet, SmallLook
from vsnbench.localization.search import TriedPose, along_surfaces
from vsnbench.localization.twin import twin_of
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import load_site
from vsnbench.values.pose import Pose

APARTMENT = load_site("apartment")
CAMERA = load_profile("turtlebot2").camera
FACING_A_BARE_WALL, FACING_A_CORNER = Pose(7.6, 5.9, math.pi), APARTMENT.start(12).pose


def alternatives(pose: Pose) -> tuple[TriedPose, ...]:
    look = NoisyEye(APARTMENT, CAMERA, 1.0, np.random.default_rng(0)).look(pose)
    sighting = LookSet(twin_of(APARTMENT), [SmallLook.of(look, 40)])
    return along_surfaces(sighting, TriedPose(pose, 0.0), 1.0)


def test_along_a_bare_wall_another_place_fits_as_well() -> None:
    along = [item for item in alternatives(FACING_A_BARE_WALL) if abs(item.pose.x_m - FACING_A_BARE_WALL.x_m) < 1e-9]
    assert len(along) == 4
    assert min(one.misfit for one in along) < 0.01


def test_in_a_corner_no_other_place_along_its_walls_does() -> None:
    tried = alternatives(FACING_A_CORNER)
    assert len(tried) == 8, "two walls, two distances to each side"
    assert min(one.misfit for one in tried) > 0.05
