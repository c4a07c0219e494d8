"""Noise and drift of a base at rest against the tolerances of its profile."""

import math
import random

import pytest

from vsnbench.robots.checkup.odometry import odometry_results
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.odometry.odometry import PlanarReading
from vsnbench.values.robot_profile import RobotProfile, Tolerances

PROFILE = load_profile("turtlebot2")


def at_rate(rate_hz: float) -> RobotProfile:
    return PROFILE.model_copy(update={"base": PROFILE.base.model_copy(update={"odometry_rate_hz": rate_hz})})


def at_rest(rate_hz: float, noise_m: float = 0.0, noise_deg: float = 0.0, drift_deg_s: float = 0.0, seed: int = 1):
    rng = random.Random(seed)
    return [
        PlanarReading(
            rng.gauss(0, noise_m),
            rng.gauss(0, noise_m),
            rng.gauss(0, math.radians(noise_deg)) + math.radians(drift_deg_s) * k / rate_hz,
            k / rate_hz,
        )
        for k in range(round(2 * rate_hz))
    ]


@pytest.mark.parametrize("rate_hz", [10, 20, 50])
@pytest.mark.parametrize(("noise_m", "noise_deg"), [(0.008, 0.0), (0.0, 0.3), (0.006, 0.4)])
def test_the_recommended_tolerances_are_met(rate_hz: float, noise_m: float, noise_deg: float) -> None:
    profile = at_rate(rate_hz)
    (result,) = odometry_results(profile, at_rest(rate_hz, noise_m, noise_deg))
    assert result.health == "failed"
    _, found, lines = result.advice.partition("tolerances: {")
    assert found
    values = dict(part.split(": ") for part in lines.rstrip("}").split(", "))
    tolerances = Tolerances(position_m=float(values["position_m"]), turn_deg=float(values["turn_deg"]))
    if not noise_m:
        assert tolerances.position_m == 0.005
    if not noise_deg:
        assert tolerances.turn_deg == 0.1
    (again,) = odometry_results(
        profile.model_copy(update={"tolerances": tolerances}), at_rest(rate_hz, noise_m, noise_deg)
    )
    assert again.health == "ok"


def test_both_axes_are_named_at_once() -> None:
    (result,) = odometry_results(PROFILE, at_rest(50, 0.01, 0.5))
    assert "mm" in result.seen
    assert "°" in result.seen


def test_noise_that_no_tolerance_allows_has_no_recommendation() -> None:
    (result,) = odometry_results(PROFILE, at_rest(50, noise_deg=40.0))
    assert "tolerances:" not in result.advice


@pytest.mark.parametrize(("rate_hz", "drift_deg_s", "health"), [
    (50, 0.1, "ok"), (50, 1.0, "failed"), (10, 0.05, "ok"), (10, 0.3, "failed"), (20, 0.5, "failed"),
])  # fmt: skip
def test_a_drift_with_which_no_base_settles_is_a_fault(rate_hz: float, drift_deg_s: float, health: str) -> None:
    (result,) = odometry_results(at_rate(rate_hz), at_rest(rate_hz, 0.0005, 0.01, drift_deg_s))
    assert result.health == health
    assert ("drifts by" in result.seen) is (health == "failed")
