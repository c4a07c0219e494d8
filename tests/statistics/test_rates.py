"""Intervals and tests of independent rates against scipy, statsmodels and enumeration."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, binomtest
from scipy.stats import t as student
from statsmodels.stats.proportion import confint_proportions_2indep

from vsnbench.statistics.rates import (
    Proportion,
    fisher,
    newcombe,
    wilson,
    wilson_at,
)

RATES = np.linspace(0.05, 0.95, 91)


@st.composite
def proportions(draw: st.DrawFn, most: int = 200) -> Proportion:
    trials = draw(st.integers(1, most))
    return Proportion(draw(st.integers(0, trials)), trials)


@settings(deadline=None)
@given(proportions(), st.sampled_from([0.8, 0.9, 0.95, 0.99]))
def test_wilson_is_that_of_scipy(proportion: Proportion, confidence: float) -> None:
    expected = binomtest(proportion.successes, proportion.trials).proportion_ci(confidence, method="wilson")
    interval = wilson(proportion, confidence)
    assert (interval.low, interval.high) == pytest.approx((expected.low, expected.high), abs=1e-12)


@settings(deadline=None)
@given(st.floats(0.01, 0.99), st.floats(1, 200), st.sampled_from([4.0, 14.0, math.inf]))
def test_the_ends_of_wilson_are_the_rates_as_far_off_as_students_t_says(rate: float, n: float, freedom: float) -> None:
    quantile = float(student.ppf(0.975, freedom))
    interval = wilson_at(rate, n, freedom=freedom)
    for end in (interval.low, interval.high):
        assert abs(rate - end) / math.sqrt(end * (1 - end) / n) == pytest.approx(quantile, rel=1e-6)


@settings(deadline=None)
@given(proportions())
def test_wilson_holds_the_rate_and_stays_within_0_and_1(proportion: Proportion) -> None:
    interval = wilson(proportion)
    assert 0 <= interval.low <= proportion.rate <= interval.high <= 1


def test_wilson_of_the_papers_totals() -> None:
    assert [round(100 * bound, 2) for bound in (wilson(Proportion(22, 75)).low, wilson(Proportion(22, 75)).high)] == [
        20.24,
        40.44,
    ]
    assert [round(100 * bound, 2) for bound in (wilson(Proportion(19, 90)).low, wilson(Proportion(19, 90)).high)] == [
        13.95,
        30.63,
    ]


def coverage(trials: int, rate: float) -> float:
    """Return the coverage of the interval, by enumeration of all samples."""
    return sum(
        float(binom.pmf(successes, trials, rate))
        for successes in range(trials + 1)
        if rate in wilson(Proportion(successes, trials))
    )


@pytest.mark.parametrize("trials", [15, 75])
def test_wilson_covers_95_percent_of_samples_over_the_true_rates(trials: int) -> None:
    covered = np.array([coverage(trials, rate) for rate in RATES])
    assert 0.94 < covered.mean() < 0.96
    assert ((covered >= 0.93) & (covered <= 0.97)).mean() > 0.6
    # Its coverage is known to drop at rates near 0 and 1.
    assert covered.min() > 0.88


@pytest.mark.parametrize(("trials", "resolution"), [(15, 10), (75, 5)])
def test_newcombe_covers_95_percent_of_pairs_of_samples(trials: int, resolution: int) -> None:
    counts = range(trials + 1)
    intervals = {(a, b): newcombe(Proportion(a, trials), Proportion(b, trials)) for a in counts for b in counts}
    rates = np.linspace(0.1, 0.9, resolution)
    chances = [
        sum(
            float(pa * pb)
            for (a, pa), (b, pb) in itertools.product(
                enumerate(binom.pmf(np.arange(trials + 1), trials, first)),
                enumerate(binom.pmf(np.arange(trials + 1), trials, second)),
            )
            if first - second in intervals[a, b]
        )
        for first, second in itertools.product(rates, rates)
        if first >= second
    ]
    assert 0.93 < np.mean(chances) < 0.97
    assert min(chances) > 0.92


@settings(deadline=None)
@given(proportions(), proportions())
def test_newcombe_is_that_of_statsmodels(first: Proportion, second: Proportion) -> None:
    expected = confint_proportions_2indep(
        first.successes, first.trials, second.successes, second.trials, method="newcomb", compare="diff"
    )
    interval = newcombe(first, second)
    assert (interval.low, interval.high) == pytest.approx(expected, abs=1e-9)


def test_newcombe_of_a_published_example() -> None:
    # Newcombe 1998, Table II, case (a): 56/70 against 48/80.
    interval = newcombe(Proportion(56, 70), Proportion(48, 80))
    assert (round(interval.low, 4), round(interval.high, 4)) == (0.0524, 0.3339)


@settings(deadline=None, max_examples=50)
@given(proportions(12), proportions(12))
def test_fisher_is_the_chance_of_tables_no_likelier_than_this(first: Proportion, second: Proportion) -> None:
    successes, total = first.successes + second.successes, first.trials + second.trials
    ways = {
        k: math.comb(first.trials, k) * math.comb(second.trials, successes - k)
        for k in range(max(0, successes - second.trials), min(first.trials, successes) + 1)
    }
    extreme = sum(count for count in ways.values() if count <= ways[first.successes])
    assert fisher(first, second) == pytest.approx(extreme / math.comb(total, successes))


def test_the_papers_models_are_not_distinguishable() -> None:
    assert fisher(Proportion(22, 75), Proportion(19, 90)) == pytest.approx(0.278, abs=0.0005)
    assert fisher(Proportion(16, 60), Proportion(14, 60)) == pytest.approx(0.833, abs=0.0005)


def test_successes_beyond_the_trials_are_refused() -> None:
    with pytest.raises(ValueError, match="3 successes in 2 trials"):
        Proportion(3, 2)
    assert math.isnan(wilson(Proportion(0, 0)).low)
    assert math.isnan(newcombe(Proportion(0, 0), Proportion(1, 2)).high)
