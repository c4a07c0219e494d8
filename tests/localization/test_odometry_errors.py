"""Errors of an odometry: none leaves the way as measured, derivatives match, and a covariance covers what they do."""

import math

import numpy as np
import pytest

from vsnbench.localization.odometry_errors import UNITS, OdometryErrors, by_errors, covariance_after
from vsnbench.values.placement import PoseCovariance
from vsnbench.values.pose import Pose

STEPS = (Pose(0.25, 0.0), Pose(0.25, 0.0, 0.02), Pose(0.0, 0.0, math.pi / 6), Pose(0.25, 0.01), Pose(-0.25, 0.0))
TRUE = OdometryErrors(way=0.04, turn=-0.02, veer_rad_per_m=0.015)
NOTHING = PoseCovariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_without_errors_the_way_is_as_measured() -> None:
    end = Pose(0.0, 0.0)
    for step in STEPS:
        end = end.compose(step)
    driven = OdometryErrors().driven(STEPS)
    assert driven.distance_to(end) < 1e-12
    assert driven.heading_rad == pytest.approx(end.heading_rad)


def test_each_error_has_its_own_effect() -> None:
    ahead = (Pose(1.0, 0.0),)
    assert OdometryErrors(way=0.05).driven(ahead).x_m == pytest.approx(1.05)
    assert OdometryErrors(turn=0.1).driven((Pose(0.0, 0.0, 1.0),)).heading_rad == pytest.approx(1.1)
    veered = OdometryErrors(veer_rad_per_m=0.1).driven(ahead)
    assert veered.heading_rad == pytest.approx(0.1)
    assert veered.y_m == pytest.approx(math.sin(0.05))
    assert OdometryErrors(veer_rad_per_m=0.1).driven((Pose(-1.0, 0.0),)).heading_rad == pytest.approx(-0.1)


@pytest.mark.parametrize("backward", [False, True])
def test_derivatives_are_the_changes_of_the_pose(backward: bool) -> None:
    by = by_errors(STEPS, TRUE, backward=backward)
    for column, unit in enumerate(UNITS):
        tiny = OdometryErrors(unit.way * 1e-4, unit.turn * 1e-4, unit.veer_rad_per_m * 1e-4)
        ends = [errors.driven(STEPS) for errors in (TRUE, TRUE.plus(tiny))]
        if backward:
            ends = [Pose(0.0, 0.0).relative_to(end) for end in ends]
        change = (ends[1].x_m - ends[0].x_m, ends[1].y_m - ends[0].y_m, ends[1].heading_rad - ends[0].heading_rad)
        assert by[:, column] == pytest.approx(np.array(change) / 1e-4, abs=1e-3)


def test_the_covariance_is_that_of_ways_with_random_errors() -> None:
    start, known = Pose(2.0, 1.0, 0.7), PoseCovariance(4e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)
    spread, rng = OdometryErrors(0.03, 0.02, 0.015), np.random.default_rng(3)
    ends = []
    for way, turn, veer in rng.normal(0.0, (0.03, 0.02, 0.015), (4000, 3)).tolist():
        dx, dy, heading = rng.multivariate_normal(np.zeros(3), known.matrix).tolist()
        begun = Pose(start.x_m + dx, start.y_m + dy, start.heading_rad + heading)
        end = begun.compose(OdometryErrors(way, turn, veer).driven(STEPS))
        ends.append((end.x_m, end.y_m, end.heading_rad))
    got = covariance_after(start, known, STEPS, spread)
    assert got.values == pytest.approx(PoseCovariance.of(np.cov(np.array(ends).T)).values, rel=0.1, abs=1.5e-5)
    assert covariance_after(start, NOTHING, (), spread) == NOTHING
