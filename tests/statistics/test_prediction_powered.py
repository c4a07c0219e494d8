"""Prediction-powered estimates against ppi-python, and coverage with good and bad simulators."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ppi_py import ppi_mean_ci, ppi_mean_pointestimate

from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.prediction_powered import OnlyPredicted, Powered, PredictedCell, best_tuning, point, powered

OUTCOMES = st.lists(
    st.tuples(st.sampled_from([0.0, 1.0]), st.sampled_from([0.0, 0.2, 0.6, 1.0])), min_size=4, max_size=40
)


@settings(deadline=None, max_examples=60)
@given(OUTCOMES, st.lists(st.sampled_from([0.0, 0.2, 0.6, 1.0]), min_size=4, max_size=60))
def test_the_point_and_the_tuning_are_those_of_ppi_python(
    driven: "list[tuple[float, float]]", others: "list[float]"
) -> None:
    real, predicted = (np.array([each[side] for each in driven]) for side in (0, 1))
    elsewhere = np.array(others)
    if np.var(np.concatenate([predicted, elsewhere])) == 0:
        assert best_tuning(real, predicted, elsewhere) == 0
        return
    tuning = best_tuning(real, predicted, elsewhere)
    expected = float(np.ravel(ppi_mean_pointestimate(real, predicted, elsewhere))[0])
    assert point(real, predicted, elsewhere, tuning) == pytest.approx(expected)


def test_of_many_trials_the_interval_is_that_of_ppi_python() -> None:
    random = np.random.default_rng(4)
    real = (random.random(600) < 0.4).astype(float)
    predicted = np.where(random.random(600) < 0.8, real, 1 - real)
    elsewhere = (random.random(3000) < 0.44).astype(float)
    found = powered(
        [PredictedCell(Cell(n, int(y), 1), float(f)) for n, (y, f) in enumerate(zip(real, predicted, strict=True))],
        [OnlyPredicted(600 + n, float(f)) for n, f in enumerate(elsewhere)],
    )
    assert found is not None
    low, high = (float(np.ravel(end)[0]) for end in ppi_mean_ci(real, predicted, elsewhere, alpha=0.05))
    assert (found.interval.low, found.interval.high) == pytest.approx((low, high), abs=0.004)
    assert found.interval.high - found.interval.low < found.plain_interval.high - found.plain_interval.low
    assert found.saved > 100


def experiment(random: np.random.Generator, rate: float, alike: float, trust: float) -> "Powered | None":
    """Return 75 cells, 25 of them real; with probability `trust` the twin has the real outcome."""
    chances = random.beta(alike * rate, alike * (1 - rate), 15)
    starts = np.repeat(np.arange(15), 5)
    real = random.random(75) < chances[starts]
    twin = np.where(random.random(75) < trust, real, random.random(75) < 0.5)
    chosen = np.isin(np.arange(75), random.permutation(75)[:25])
    return powered(
        [PredictedCell(Cell(int(starts[n]), int(real[n]), 1), float(twin[n])) for n in np.flatnonzero(chosen)],
        [OnlyPredicted(int(starts[n]), float(twin[n])) for n in np.flatnonzero(~chosen)],
    )


@pytest.mark.parametrize("trust", [0.0, 0.6, 0.95])
@pytest.mark.parametrize("rate", [0.3, 0.5])
def test_it_covers_as_often_as_promised_whatever_the_simulator_is_worth(rate: float, trust: float) -> None:
    random = np.random.default_rng(7)
    found = [each for _ in range(400) if (each := experiment(random, rate, 10.0, trust))]
    assert np.mean([rate in each.interval for each in found]) >= 0.92  # 93 %, minus the sampling error of 400 samples
    assert np.mean([each.rate for each in found]) == pytest.approx(rate, abs=0.02)
    saved = float(np.mean([each.saved for each in found]))
    assert saved < 1 if trust == 0 else saved > 4
    wide, plain = (
        float(np.mean([each.high - each.low for each in ends]))
        for ends in ([each.interval for each in found], [each.plain_interval for each in found])
    )
    assert wide <= plain  # on average never wider than without the simulator; with a good one much shorter
    assert trust < 0.9 or wide < 0.8 * plain


def test_where_the_simulator_would_widen_the_interval_it_is_not_listened_to() -> None:
    random = np.random.default_rng(1)
    worthless = [each for _ in range(100) if (each := experiment(random, 0.4, 10.0, 0.0))]
    unheard = [each for each in worthless if each.tuning == 0]
    assert len(unheard) > 50
    assert all(each.interval == each.plain_interval and each.rate == each.plain_rate for each in unheard)
    assert all(each.saved > 0 for each in worthless if each.tuning > 0)


def test_with_too_little_to_go_by_nothing_is_said() -> None:
    driven = [PredictedCell(Cell(n, 1, 1), 1.0) for n in range(4)]
    assert powered(driven, []) is None
    assert powered(driven[:2], [OnlyPredicted(9, 1.0)]) is None
    assert powered([PredictedCell(Cell(1, 1, 1), 1.0)] * 5, [OnlyPredicted(9, 1.0)]) is None
    blind = powered(driven, [OnlyPredicted(n, 1.0) for n in range(5, 9)])
    assert blind is not None
    assert (blind.tuning, blind.rate, blind.saved) == (0.0, 1.0, 0.0)
    assert blind.interval == blind.plain_interval
