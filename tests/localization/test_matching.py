"""Placements from depth images: correct uncertainty, no false green, undetermined if ambiguous."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.support.placement_trials import NoisyEye, Trial, draw_trial, with_corners_off
from vsnbench.localization.looks import DepthLook
from vsnbench.localization.matching import PlacementMatcher
from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.generated_sites.generate import generate_site
from vsnbench.sites.site import load_site
from vsnbench.values.placement import PlacementMethod
from vsnbench.values.pose import Attitude, Pose

APARTMENT = load_site("apartment")
CAMERA = load_profile("turtlebot2").camera
MATCHER = PlacementMatcher(APARTMENT)
FACING_A_BARE_WALL = 1


def trial_at(number: int, seed: int, most_m: float = 0.40, most_deg: float = 25.0) -> tuple[Trial, NoisyEye]:
    rng = np.random.default_rng([seed, number])
    trial = draw_trial(APARTMENT, APARTMENT.start(number), rng, most_m, most_deg)
    return trial, NoisyEye(trial.room, CAMERA, trial.depth_scale, rng)


def test_an_offset_is_measured_in_a_room_that_is_not_quite_as_surveyed() -> None:
    errors_m, errors_deg, covered = [], [], 0
    for number in (4, 5, 8, 9, 11, 12):
        trial, eye = trial_at(number, seed=2)
        got = MATCHER.measure(trial.start, [eye.look(trial.pose)])
        errors_m.append(got.pose.distance_to(trial.pose))
        errors_deg.append(abs(math.degrees(math.remainder(got.pose.heading_rad - trial.pose.heading_rad, math.tau))))
        covered += got.region_holds(trial.pose)
        assert got.method is PlacementMethod.LOOK
        off = trial.pose.relative_to(got.mark)
        assert not got.within_tolerance or math.hypot(*off.position) <= got.tolerance.distance_m
    assert np.median(errors_m) < 0.04
    assert np.median(errors_deg) < 0.5
    assert covered >= 5


def test_a_bare_wall_does_not_determine_left_and_right_but_a_turn_does() -> None:
    trial, eye = trial_at(FACING_A_BARE_WALL, seed=3, most_m=0.10, most_deg=3.0)
    look = MATCHER.measure(trial.start, [eye.look(trial.pose)])
    assert look.undetermined == ("left-right",)
    assert not look.within_tolerance
    assert look.arrows == ()
    assert "turn on the spot" in look.advice
    around, end = eye.turn(trial.pose, 6, turn_error=0.01)
    turn = MATCHER.measure(trial.start, around)
    assert turn.determined
    assert turn.method is PlacementMethod.TURN
    assert turn.pose.distance_to(end) < 0.05
    assert math.degrees(abs(math.remainder(turn.pose.heading_rad - end.heading_rad, math.tau))) < 1.0
    assert turn.region_holds(end)


def test_headings_that_the_odometry_wraps_are_those_of_one_turn() -> None:
    start = APARTMENT.start(5)
    rng = np.random.default_rng(1)
    around, end = NoisyEye(APARTMENT, CAMERA, 1.0, rng).turn(start.pose, 6, turn_error=0.02)
    wrapped = [replace(look, odometry=Pose(0.0, 0.0, look.odometry.heading_rad).wrapped) for look in around]
    got = MATCHER.measure(start, wrapped)
    assert got.pose.distance_to(end) < 0.03
    assert abs(math.remainder(got.pose.heading_rad - end.heading_rad, math.tau)) < math.radians(0.5)


def test_each_look_of_a_body_that_leans_has_its_own_camera() -> None:
    start = APARTMENT.start(3)
    looks = []
    for number, pitch_deg in enumerate([4.0, -3.0]):
        rng = np.random.default_rng(number)
        camera = CAMERA.on(Attitude(0.0, math.radians(pitch_deg)))
        turned = Pose(0.0, 0.0, 0.5 * number)
        looks.append(NoisyEye(APARTMENT, camera, 1.0, rng).look(start.pose.compose(turned), turned))
    end = start.pose.compose(turned)
    assert MATCHER.measure(start, looks).pose.distance_to(end) < 0.01
    one_camera = [replace(look, camera=looks[-1].camera) for look in looks]
    assert MATCHER.measure(start, one_camera).pose.distance_to(end) > 0.03


def test_removed_objects_are_reported_and_do_not_bias() -> None:
    start = APARTMENT.start(9)
    rng = np.random.default_rng(5)
    everything = NoisyEye(APARTMENT, CAMERA, 1.0, rng).look(start.pose)
    assert MATCHER.measure(start, [everything]).moved == ()
    gone = "desk"
    without = APARTMENT.model_copy(update={"objects": [one for one in APARTMENT.objects if one.id != gone]})
    got = MATCHER.measure(start, [NoisyEye(without, CAMERA, 1.0, rng).look(start.pose)])
    assert gone in got.moved
    assert got.differs.startswith("the plan and the room differ here: ")
    assert got.pose.distance_to(start.pose) < 0.05


@pytest.mark.parametrize("depth_m", [np.nan, 0.0, np.inf])
def test_almost_no_depth_determines_nothing(depth_m: float) -> None:
    blind = DepthLook(np.full((480, 640), depth_m, np.float32), Pose(0.0, 0.0), CAMERA)
    got = MATCHER.measure(APARTMENT.start(3), [blind])
    assert got.undetermined == ("forward-back", "left-right", "heading")
    assert not got.within_tolerance


def test_a_robot_at_another_mark_is_not_in_place() -> None:
    rng = np.random.default_rng(6)
    eye = NoisyEye(APARTMENT, CAMERA, 1.0, rng)
    for stands, said in ((3, 4), (12, 11)):
        got = MATCHER.measure(APARTMENT.start(said), [eye.look(APARTMENT.start(stands).pose)])
        assert not got.within_tolerance


def test_what_was_moved_does_not_draw_the_pose_to_where_it_would_fit() -> None:
    rng = np.random.default_rng([12, 17])
    trial = draw_trial(APARTMENT, APARTMENT.start(7), rng)
    eye = NoisyEye(trial.room, CAMERA, trial.depth_scale, rng)
    got = MATCHER.measure(trial.start, [eye.look(trial.pose)])
    assert {"cabinet-1", "chair-3"} == set(trial.moved), "both fill the image"
    assert not got.determined or got.region_holds(trial.pose)


def test_a_fit_that_hinges_on_the_edge_of_what_was_moved_is_not_sure_along_the_wall() -> None:
    rng = np.random.default_rng([12, 60])
    trial = draw_trial(APARTMENT, APARTMENT.start(2), rng)
    got = MATCHER.measure(trial.start, [NoisyEye(trial.room, CAMERA, trial.depth_scale, rng).look(trial.pose)])
    assert "wardrobe-1" in trial.moved, "only a corner of it is visible next to a wall"
    assert not got.determined
    assert got.region_holds(trial.pose)


def test_a_coarse_survey_increases_the_uncertainty_of_the_placement() -> None:
    rng = np.random.default_rng(8)
    start = APARTMENT.start(12)
    coarse = APARTMENT.model_copy(update={"survey_error_m": 0.03})
    room = with_corners_off(APARTMENT, 0.03, rng)
    look = NoisyEye(room, CAMERA, 1.0, rng).look(start.pose)
    usual, doubting = (PlacementMatcher(site).measure(start, [look]) for site in (APARTMENT, coarse))
    assert doubting.region_holds(start.pose)
    assert doubting.region_m > 1.5 * usual.region_m


def test_what_fits_farther_off_than_robots_are_looked_for_is_not_where_it_stands() -> None:
    site = generate_site(1)
    rng = np.random.default_rng([33, 40])
    trial = draw_trial(site, site.start(6), rng, 0.15, 5.0)
    look = NoisyEye(trial.room, CAMERA, trial.depth_scale, rng).look(trial.pose)
    got = PlacementMatcher(site).measure(trial.start, [look])
    assert not got.determined or got.region_holds(trial.pose)
    assert not got.fits or math.hypot(*got.offset.position) < 0.60, "an identical cupboard front is 1 m to the side"


def test_a_turn_finds_how_far_ahead_the_camera_sits() -> None:
    trial, _ = trial_at(5, seed=5, most_m=0.10, most_deg=4.0)
    ahead = CAMERA.model_copy(update={"mount_forward_m": CAMERA.mount_forward_m + 0.10})
    eye = NoisyEye(trial.room, ahead, trial.depth_scale, np.random.default_rng(5))
    around, end = eye.turn(trial.pose, count=6)
    turn = MATCHER.measure(trial.start, [replace(look, camera=CAMERA) for look in around])
    assert turn.forward_m == pytest.approx(0.10, abs=0.015)
    assert turn.region_holds(end)
    assert "camera.mount_forward_m" in turn.differs
