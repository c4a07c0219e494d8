"""Reported differences from the plan: removed objects, not occluded or slightly displaced ones."""

import numpy as np
import pytest

from benchmarks.support.placement_trials import NoisyEye
from vsnbench.localization.looks import DepthLook
from vsnbench.localization.matching import PlacementMatcher
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import Site, SiteObject, load_site
from vsnbench.values.placement import MeasuredPlacement

APARTMENT = load_site("apartment")
CAMERA = load_profile("turtlebot2").camera
START = APARTMENT.start(9)
CHAIR = "office-chair"
"""Object in front of the robot at that start."""


def measured(room: Site) -> MeasuredPlacement:
    look = NoisyEye(room, CAMERA, 1.0, np.random.default_rng(4)).look(START.pose)
    return PlacementMatcher(APARTMENT).measure(START, [look])


def room_with(*things: SiteObject) -> Site:
    others = [one for one in APARTMENT.objects if one.id not in {thing.id for thing in things}]
    return APARTMENT.model_copy(update={"objects": [*others, *things]})


def chair_moved(by_m: float) -> SiteObject:
    chair = next(one for one in APARTMENT.objects if one.id == CHAIR)
    return chair.model_copy(update={"position": (chair.position[0] - by_m, chair.position[1])})


def test_a_chair_that_was_moved_is_named() -> None:
    assert measured(room_with(chair_moved(0.7))).moved == (CHAIR,)


def test_a_chair_a_few_centimetres_off_the_survey_is_not_named() -> None:
    assert measured(room_with(chair_moved(0.05))).moved == ()


def test_what_is_hidden_by_something_that_came_is_not_named() -> None:
    chair = chair_moved(0.0)
    screen = SiteObject(
        id="screen", category="cabinet", position=(chair.position[0], chair.position[1] + 0.5), size_m=(0.1, 0.8, 1.1),
        heading_deg=90,
    )  # fmt: skip
    assert measured(room_with(screen)).moved == ()


def test_nothing_is_named_where_it_is_not_known_where_the_robot_stands() -> None:
    blind = DepthLook(np.full((480, 640), np.nan, np.float32), START.pose, CAMERA)
    got = PlacementMatcher(APARTMENT).measure(START, [blind])
    assert got.undetermined
    assert got.moved == ()


@pytest.mark.parametrize("scale", [0.99, 1.01])
def test_a_camera_that_is_off_in_scale_names_nothing(scale: float) -> None:
    look = NoisyEye(APARTMENT, CAMERA, scale, np.random.default_rng(4)).look(START.pose)
    assert PlacementMatcher(APARTMENT).measure(START, [look]).moved == ()
