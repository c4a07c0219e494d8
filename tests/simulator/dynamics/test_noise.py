"""Noise models: seeded, absent where the robot stands still, and as large as they say."""

import math

import numpy as np
import numpy.typing as npt
import pytest

from vsnbench.simulator.dynamics.noise import DepthNoise, OdometryDrift, OdometryNoise, noisy_depth
from vsnbench.values.pose import Pose

SHAPE = (240, 320)
GREY = np.full((*SHAPE, 3), 128, np.uint8)
MATT = np.zeros(SHAPE, np.float32)


def flat(depth_m: float) -> npt.NDArray[np.float32]:
    return np.full(SHAPE, depth_m, np.float32)


def lost(depth_m: npt.NDArray[np.float32]) -> float:
    return float(np.isnan(depth_m).mean())


def shot(
    depth_m: npt.NDArray[np.float32],
    rgb: npt.NDArray[np.uint8] = GREY,
    shininess: npt.NDArray[np.float32] = MATT,
    seed: int = 0,
) -> npt.NDArray[np.float32]:
    return noisy_depth(depth_m, rgb, shininess, DepthNoise(), np.random.default_rng(seed))


@pytest.mark.parametrize("distance_m", [0.5, 2.0, 6.0])
def test_depth_error_grows_with_the_square_of_the_distance(distance_m: float) -> None:
    seen = shot(flat(distance_m))
    noise = DepthNoise()
    expected = noise.near_std_m + noise.square_std_per_m * distance_m**2
    assert float(np.std(seen)) == pytest.approx(expected, rel=0.05)
    assert float(np.mean(seen)) == pytest.approx(distance_m, abs=expected / 10)
    assert lost(seen) == 0


def test_pixels_get_lost_at_edges_and_nowhere_else() -> None:
    step = flat(1.0)
    step[:, 160:] = 3.0
    seen = shot(step)
    assert 0.4 < lost(seen[:, 159:161]) < 0.8
    assert lost(seen[:, :159]) == lost(seen[:, 161:]) == 0


def test_pixels_get_lost_on_dark_and_on_shiny_surfaces() -> None:
    half_dark = GREY.copy()
    half_dark[:, :160] = 5
    dark = shot(flat(1.0), rgb=half_dark)
    assert 0.4 < lost(dark[:, :160]) < 0.6
    assert lost(dark[:, 160:]) == 0
    half_shiny = MATT.copy()
    half_shiny[:, :160] = 0.5
    shiny = shot(flat(1.0), shininess=half_shiny)
    assert 0.2 < lost(shiny[:, :160]) < 0.4
    assert lost(shiny[:, 160:]) == 0


def test_nothing_stays_nothing() -> None:
    hole = flat(2.0)
    hole[100:120, 100:120] = np.inf
    hole[10:20, 10:20] = np.nan
    seen = shot(hole)
    assert np.isnan(seen[100:120, 100:120]).all()
    assert np.isnan(seen[10:20, 10:20]).all()
    assert seen.dtype == np.float32


def test_depth_noise_follows_from_its_seed() -> None:
    assert np.array_equal(shot(flat(2.0), seed=4), shot(flat(2.0), seed=4), equal_nan=True)
    assert not np.array_equal(shot(flat(2.0), seed=4), shot(flat(2.0), seed=5), equal_nan=True)


def walk(drift: OdometryDrift, metres: float, steps: int = 200) -> Pose:
    pose = Pose(0.0, 0.0)
    for k in range(1, steps + 1):
        pose = drift.update(Pose(metres * k / steps, 0.0, 0.0))
    return pose


def test_odometry_of_a_perfect_robot_does_not_drift() -> None:
    perfect = OdometryNoise(way_scale_std=0, turn_scale_std=0, wander_rad_per_sqrt_m=0)
    drift = OdometryDrift(perfect, np.random.default_rng(0))
    circle = [Pose(math.sin(k / 50), 1 - math.cos(k / 50), k / 50) for k in range(1, 315)]
    for pose in circle:
        seen = drift.update(pose)
    assert seen.distance_to(circle[-1]) < 1e-3
    assert seen.heading_rad == pytest.approx(circle[-1].heading_rad)


def test_odometry_does_not_drift_while_standing() -> None:
    drift = OdometryDrift(OdometryNoise(), np.random.default_rng(0))
    before = walk(drift, 1.0)
    for _ in range(100):
        assert drift.update(Pose(1.0, 0.0, 0.0)) == before


def test_odometry_drifts_as_much_as_it_says() -> None:
    """Over many robots: the error of a way of 4 m and the spread of headings after it."""
    ends = [walk(OdometryDrift(OdometryNoise(), np.random.default_rng(seed)), 4.0) for seed in range(300)]
    assert np.std([end.x_m for end in ends]) == pytest.approx(0.01 * 4, rel=0.2)
    assert np.std([end.heading_rad for end in ends]) == pytest.approx(0.01 * 2, rel=0.2)


def test_odometry_drift_follows_from_its_seed() -> None:
    one, same, other = (walk(OdometryDrift(OdometryNoise(), np.random.default_rng(seed)), 2.0) for seed in (7, 7, 8))
    assert one == same != other
