"""Odometry noise at rest is measured without drift, and never while the base is moved."""

import random

import pytest

from vsnbench.control.standstill import (
    QUIET,
    NoiseMeter,
    PathRest,
    RestWindow,
    StandstillNoise,
    is_quiet,
    noise_of,
    too_noisy,
)
from vsnbench.values.pose import Pose


def readings(count: int, noise_m: float, drift_m: float = 0.0, seed: int = 1) -> list[Pose]:
    rng = random.Random(seed)
    return [Pose(drift_m * i + rng.gauss(0, noise_m), rng.gauss(0, noise_m), rng.gauss(0, 0.001)) for i in range(count)]


@pytest.mark.parametrize("drift_m", [0.0, 0.001])
def test_noise_is_measured_despite_a_drift(drift_m: float) -> None:
    meter = NoiseMeter()
    for seed in range(10):
        meter.add(readings(20, 0.002, drift_m, seed))
    assert meter.noise.position_m == pytest.approx(0.002, rel=0.15)
    assert meter.noise.heading_rad == pytest.approx(0.001, rel=0.15)
    assert meter.bound.position_m > meter.noise.position_m


def test_a_base_that_is_pushed_is_not_noisy() -> None:
    pushed = [Pose(0.0 if i < 10 else 0.004 * (i - 10), 0.0, 0.0) for i in range(40)]
    assert noise_of(pushed) == QUIET


def test_a_base_that_stands_exactly_is_quiet() -> None:
    assert noise_of([Pose(1.0, 2.0, 0.5)] * 30) == QUIET
    assert is_quiet(0.0, 0.005)


@pytest.mark.parametrize(
    ("noise_deg", "rate_hz", "too_large"), [(0.05, 20, False), (0.05, 50, False), (0.15, 50, True)]
)
def test_noise_is_too_large_where_no_short_window_proves_the_tolerance(noise_deg, rate_hz, too_large) -> None:
    assert too_noisy(noise_deg, 0.1, 0.5, rate_hz) is too_large


def test_a_window_of_a_base_that_still_rolls_gives_no_estimate() -> None:
    window = RestWindow(noise=0.001, start_error=0.0, tolerance=0.005)
    window.restart(0.0)
    assert all(window.add(0.02 - 0.005 * i, 0.05 * i) is None for i in range(8))


def test_an_estimate_is_within_the_tolerance_only_by_its_bound() -> None:
    window = RestWindow(noise=0.002, start_error=0.0, tolerance=0.005)
    window.restart(0.0)
    estimates = [window.add(0.003, 0.05 * i) for i in range(40)]
    proven = [bool(estimate and estimate.within(0.005)) for estimate in estimates]
    assert not proven[5]
    assert proven[-1]


def test_noise_of_the_heading_is_measured_beside_exact_positions() -> None:
    """Rounding errors of exact encoders are correlated, as if the base were pushed; they say nothing about the gyro."""
    rng = random.Random(2)
    meter = NoiseMeter()
    for rest in range(6):
        x_m = 0.1 + 0.3 * rest
        poses = [Pose(x_m + 1e-17 * (i // 12), 0.7 + 1e-16 * (i // 9), rng.gauss(0, 0.0007)) for i in range(40)]
        meter.add(poses)
    assert meter.noise.position_m < 1e-12
    assert meter.noise.heading_rad == pytest.approx(0.0007, rel=0.2)
    assert meter.freedom == 6 * 38


def test_a_push_along_one_axis_is_not_the_noise_of_it() -> None:
    rng = random.Random(3)
    pushed = [Pose(0.004 * max(i - 10, 0), rng.gauss(0, 0.001), rng.gauss(0, 0.0005)) for i in range(40)]
    noise = noise_of(pushed)
    assert noise.position_m == pytest.approx(0.001, rel=0.3)
    assert noise.heading_rad == pytest.approx(0.0005, rel=0.3)


@pytest.mark.parametrize("noise_m", [0.0, 0.002])
def test_a_base_at_the_end_of_a_path_is_at_rest_only_when_it_has_stopped(noise_m: float) -> None:
    rng = random.Random(4)
    rest = PathRest(StandstillNoise(noise_m, 0.0), 0.06, 0.002, 0.004)
    rest.begin(0.0)
    rested_s = None
    for k in range(200):
        at_s = k * 0.02
        rolled_m = 0.1 * (1 - 2.718 ** (-at_s / 0.2))
        if rest.add(Pose(rolled_m + rng.gauss(0, noise_m), rng.gauss(0, noise_m)), at_s):
            rested_s = at_s
            break
    assert rested_s is not None
    assert 0.4 < rested_s < 2.0
