"""The covariance of a pose includes survey errors and probably moved objects."""

import numpy as np

from vsnbench.localization.normal_equations import NormalEquations, Rows

CHAIR, WALL = 0, 1
PIXELS = 40
SURVEYED_M, MOVED, MOVED_M = 0.02, 0.1, 0.5


def equations(chair_off_m: float, wall_ahead: bool = True) -> NormalEquations:
    """A chair with visible front and side, and a wall ahead, after the fit: x ahead, y to the left.

    Only the chair constrains y; chair and wall both constrain x.
    """
    ahead, aside = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    kinds = [(CHAIR, ahead, [-1.0, 0.0], chair_off_m), (CHAIR, aside, [0.0, -1.0], 0.0)]
    if wall_ahead:
        kinds.append((WALL, ahead, [-1.0, 0.0], 0.0))
    group = np.repeat([kind[0] for kind in kinds], PIXELS).astype(np.intp)
    common = np.repeat(np.array([kind[1] for kind in kinds]), PIXELS, axis=0)
    own = np.repeat(np.array([kind[2] for kind in kinds]), PIXELS, axis=0)
    residual_m = np.repeat([kind[3] for kind in kinds], PIXELS)
    weight = np.full(len(group), 0.01**-2)
    prior = (np.array([0.6, 0.6, 0.7]), np.array([[SURVEYED_M] * 2, [0.01] * 2]), 25.0)
    pose, steps = np.zeros(3), np.zeros((2, 2))
    for _ in range(2):
        moved_m = residual_m + common @ pose + (own * steps[group]).sum(axis=1)
        system = NormalEquations([Rows(moved_m, common, group, own, weight)], *prior, pose, steps)
        step, own_step = system.step(np.full(3, 10.0))
        pose, steps = pose + step, steps + own_step
    return system


def spread_m(system: NormalEquations) -> tuple[float, float]:
    covariance = system.doubted([CHAIR], MOVED, SURVEYED_M, MOVED_M)
    return float(np.sqrt(covariance[0, 0])), float(np.sqrt(covariance[1, 1]))


def test_no_number_of_pixels_makes_a_pose_surer_than_the_survey_of_what_they_show() -> None:
    ahead_m, aside_m = spread_m(equations(0.0))
    assert 0.005 < ahead_m < 0.015
    assert aside_m > SURVEYED_M


def test_a_chair_that_agrees_with_the_wall_was_hardly_moved_sideways() -> None:
    _, aside_m = spread_m(equations(0.0))
    assert aside_m < 0.06


def test_a_direction_that_only_a_moved_chair_constrains_is_not_determined() -> None:
    _, right_m = spread_m(equations(0.02))
    _, off_m = spread_m(equations(0.15))
    assert off_m > 0.10 > right_m


def test_where_nothing_else_can_tell_a_chair_may_have_been_moved_as_likely_as_before() -> None:
    ahead_m, aside_m = spread_m(equations(0.0, wall_ahead=False))
    expected_m = np.sqrt(MOVED * 0.6**2)
    assert 0.5 * expected_m < ahead_m < 1.2 * expected_m
    assert 0.5 * expected_m < aside_m < 1.2 * expected_m
