"""Intervals for correlated episodes: special cases, effect of copies, and coverage."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import expit, ndtri

from vsnbench.statistics.balanced import rate_intervals
from vsnbench.statistics.clustered import (
    Cell,
    Outcomes,
    effective_sample,
    independent_difference,
    independent_outcomes,
    rate_interval,
)
from vsnbench.statistics.rates import UNKNOWN, Proportion, newcombe, wilson


def outcomes(counts: "list[tuple[int, int, int]]") -> Outcomes:
    return Outcomes(tuple(Cell(*each) for each in counts))


@settings(deadline=None)
@given(st.integers(1, 60), st.integers(1, 60), st.data())
def test_with_one_episode_a_position_they_are_wilsons_and_newcombes(n: int, m: int, data: st.DataObject) -> None:
    first = Proportion(data.draw(st.integers(0, n)), n)
    second = Proportion(data.draw(st.integers(0, m)), m)
    a, b = (independent_outcomes(each) for each in (first, second))
    mine, wilsons = rate_interval(a), wilson(first)
    assert (mine.low, mine.high) == pytest.approx((wilsons.low, wilsons.high))
    difference, newcombes = independent_difference(a, b), newcombe(first, second)
    if max(n, m) < 3:
        assert not difference.known
    else:
        assert (difference.low, difference.high) == pytest.approx((newcombes.low, newcombes.high))


SEVERAL = st.lists(st.tuples(st.integers(1, 6), st.booleans()), min_size=1, max_size=40)


@settings(deadline=None)
@given(SEVERAL, st.integers(2, 9))
def test_copies_of_every_episode_leave_the_interval_as_it_was(cells: "list[tuple[int, bool]]", copies: int) -> None:
    once = rate_interval(outcomes([(start, int(success), 1) for start, success in cells]))
    often = rate_interval(outcomes([(start, copies * success, copies) for start, success in cells]))
    assert (often.low, often.high) == pytest.approx((once.low, once.high))


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(1, 6), st.integers(0, 5)), min_size=1, max_size=40))
def test_an_effective_sample_is_never_more_than_the_episodes(cells: "list[tuple[int, int]]") -> None:
    found = outcomes([(start, successes, 5) for start, successes in cells])
    sample, interval = effective_sample(found), rate_interval(found)
    assert 0 < sample.trials <= 5 * len(cells) * (1 + 1e-9)
    assert 0 <= interval.low <= found.proportion.rate + 1e-12
    assert found.proportion.rate - 1e-12 <= interval.high <= 1


def test_seventy_five_episodes_of_one_deterministic_policy_are_fifteen_facts() -> None:
    copied = outcomes([(start, 5 * (start <= 9), 5) for start in range(1, 16)])
    assert effective_sample(copied).trials == pytest.approx(15)
    assert rate_interval(copied).low == pytest.approx(wilson(Proportion(9, 15)).low)


def test_the_variance_is_that_of_a_regression_with_clustered_errors() -> None:
    import statsmodels.api as sm

    random = np.random.default_rng(5)
    cells = [(start, int(random.binomial(3, chance)), 3) for start, chance in enumerate(random.beta(1, 1, 12))]
    success = np.concatenate([[1] * k + [0] * (n - k) for _, k, n in cells])
    start = np.concatenate([[cluster] * n for cluster, _, n in cells])
    fit = sm.OLS(success, np.ones(len(success))).fit(
        cov_type="cluster", cov_kwds={"groups": start, "use_correction": True}
    )
    assert effective_sample(outcomes(cells)).variance == pytest.approx(float(fit.cov_params()[0, 0]))


def test_with_equal_outcomes_cells_count_once_and_correlate_by_half_in_a_position() -> None:
    assert effective_sample(outcomes([(start, 0, 5) for start in range(15)])).trials == pytest.approx(15)
    # Five goals from each position, once each: 75 cells with unknown correlation. 75 / (1 + 4 * 0.5).
    assert effective_sample(outcomes([(start, 0, 1) for start in range(15)] * 5)).trials == pytest.approx(25)
    assert effective_sample(outcomes([(1, 3, 5)])).trials == 1  # a single cell
    assert rate_interval(Outcomes(())) is UNKNOWN
    assert independent_difference(Outcomes(()), outcomes([(1, 1, 1)])) is UNKNOWN


def test_fewer_failures_never_lower_the_bound_by_more_than_rounding() -> None:
    bounds = []
    for failures in range(8, -1, -1):
        cells = [(start, int(goal * 15 + start >= failures), 1) for goal in range(5) for start in range(15)]
        bounds.append(rate_interval(outcomes(cells)).low)
    assert all(after > before - 0.005 for before, after in itertools.pairwise(bounds))


@pytest.mark.parametrize("seeds", [2, 3, 5])
def test_one_success_under_several_seeds_is_not_twice_as_sure_as_none(seeds: int) -> None:
    bounds = []
    for successes in range(5):
        cells = [(start, int(start < successes), seeds) for start in range(15)]
        bounds.append(rate_interval(outcomes(cells)).high)
    assert bounds[0] == pytest.approx(wilson(Proportion(0, 15)).high)
    assert all(after > before - 0.011 for before, after in itertools.pairwise(bounds))


@pytest.mark.parametrize(("starts", "alike"), [(5, 0.1), (5, 0.5), (8, 0.2), (15, 0.02), (15, 0.5)])
def test_few_positions_of_several_goals_are_covered_as_often_as_promised(starts: int, alike: float) -> None:
    random, samples = np.random.default_rng(13), 300
    sums = 1 / alike - 1
    for rate in (0.1, 0.5, 0.8):
        held = 0
        for _ in range(samples):
            chances = random.beta(sums * rate, sums * (1 - rate), starts)
            wins = random.random((5, starts)) < chances
            cells = [(start, int(wins[goal, start]), 1) for goal in range(5) for start in range(starts)]
            held += rate in rate_interval(outcomes(cells))
        assert held / samples >= 0.91  # 93 %, minus the sampling error of 300 samples


@pytest.mark.parametrize(("concentration", "rate"), [(1.0, 0.1), (1.0, 0.8), (4.0, 0.3), (4.0, 0.5), (1e6, 0.5)])
def test_fifteen_positions_under_five_seeds_are_covered_as_often_as_promised(concentration: float, rate: float) -> None:
    random = np.random.default_rng(11)
    samples, held, plain = 600, 0, 0
    for _ in range(samples):
        chances = random.beta(concentration * rate, concentration * (1 - rate), 15)
        found = outcomes([(start, int(random.binomial(5, chance)), 5) for start, chance in enumerate(chances)])
        held += rate in rate_interval(found)
        plain += rate in wilson(found.proportion)
    assert held / samples >= 0.925  # 93 %, minus the sampling error of 600 samples
    if concentration <= 4:
        assert plain / samples < 0.89  # with all episodes taken as independent


def test_counts_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="a cell cannot have"):
        Cell(1, 3, 2)
    with pytest.raises(ValueError, match="a cell cannot have"):
        Cell(1, 0, 0)
    assert math.isnan(Outcomes(()).proportion.rate)


@pytest.mark.parametrize(("spread", "seeds_alike"), [(2.5, False), (4.0, False), (4.0, True)])
@pytest.mark.parametrize("rate", [0.1, 0.2])
def test_rates_of_goals_and_seeds_are_covered_despite_position_effects(
    rate: float, spread: float, seeds_alike: bool
) -> None:
    random = np.random.default_rng(4)
    shape = (3000, 15, 6)
    at = brentq(lambda mean: np.mean(expit(mean + spread * ndtri((np.arange(2000) + 0.5) / 2000))) - rate, -60, 60)
    start = math.sqrt(0.7) * random.standard_normal((3000, 15, 1))
    chances = expit(at + spread * (start + math.sqrt(0.3) * random.standard_normal(shape)))
    seeds = 1 if seeds_alike else 5
    means = random.binomial(seeds, chances) / seeds  # seeds that all agree are copies
    found = rate_intervals(means, 5, 0.95)
    assert np.mean((found.low <= rate) & (rate <= found.high)) >= 0.93
