"""The fit's derivatives match its residuals, for the pose and all camera errors."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.support.placement_trials import NoisyEye
from vsnbench.localization.fit import ErrorModel, FitState, PoseFit
from vsnbench.localization.looks import LookSet, SmallLook
from vsnbench.localization.twin import twin_of
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import load_site
from vsnbench.values.pose import Pose

APARTMENT = load_site("apartment")
CAMERA = load_profile("turtlebot2").camera.model_copy(update={"tilt_deg": -12.0})
UNKNOWNS = ("x", "y", "heading", "scale", "tilt", "turn", "roll", "focal", "height", "forward")


@pytest.fixture(scope="module")
def fit() -> tuple[PoseFit, FitState]:
    twin, start = twin_of(APARTMENT), APARTMENT.starts[4]
    look = NoisyEye(APARTMENT, CAMERA, 1.0, np.random.default_rng(0)).look(start.pose)
    sighting = LookSet(twin, [SmallLook.of(look, 80)])
    return PoseFit(sighting, ErrorModel()), FitState.at(start.pose, twin)


@pytest.mark.parametrize("number", range(len(UNKNOWNS)), ids=UNKNOWNS)
def test_a_derivative_is_the_change_of_the_residuals(fit: tuple[PoseFit, FitState], number: int) -> None:
    equations, state = fit
    look, tiny = equations.sighting.looks[0], np.zeros(len(UNKNOWNS))
    tiny[number] = 1e-6
    here = equations._rows_of(look, state, 0.06)
    there = equations._rows_of(look, state.moved(tiny, np.zeros_like(state.steps)), 0.06)
    same = here.group.shape == there.group.shape
    assert same
    change = (there.residual_m - here.residual_m) / 1e-6
    # A few pixels at edges show another face after the step.
    assert np.mean(np.abs(change - here.common[:, number]) < 1e-3 * (1 + np.abs(change))) > 0.99


@pytest.fixture(scope="module")
def fit_of_a_way() -> tuple[PoseFit, FitState]:
    twin, start = twin_of(APARTMENT), APARTMENT.starts[4]
    earlier = start.pose.compose(Pose(-0.5, 0.05, 0.3))
    step = start.pose.relative_to(earlier)
    look = NoisyEye(APARTMENT, CAMERA, 1.0, np.random.default_rng(0)).look(earlier)
    looks = [replace(SmallLook.of(look, 80), steps=(step,))]
    return PoseFit(LookSet(twin, looks), ErrorModel()), FitState.at(start.pose, twin)


@pytest.mark.parametrize("number", [0, 2, 5, 10, 11], ids=("x", "heading", "turn", "way", "veer"))
def test_a_derivative_of_looks_on_a_way_is_the_change_of_the_residuals(
    fit_of_a_way: tuple[PoseFit, FitState], number: int
) -> None:
    equations, state = fit_of_a_way
    look, tiny = equations.sighting.looks[0], np.zeros(12)
    tiny[number] = 1e-6
    here = equations._rows_of(look, state, 0.06)
    there = equations._rows_of(look, state.moved(tiny, np.zeros_like(state.steps)), 0.06)
    assert here.common.shape[1] == 12
    change = (there.residual_m - here.residual_m) / 1e-6
    assert np.mean(np.abs(change - here.common[:, number]) < 1e-3 * (1 + np.abs(change))) > 0.99
