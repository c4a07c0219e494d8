"""The statistics against independent implementations, by counting every outcome, and against cases worked by hand."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom
from statsmodels.stats.contingency_tables import mcnemar as statsmodels_mcnemar
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import confint_proportions_2indep, power_proportions_2indep, proportion_confint

from vsnbench.statistics.rates import (
    BARNARD_LIMIT,
    UNKNOWN,
    ClusterSums,
    Proportion,
    Stratum,
    barnard,
    clustered_bootstrap,
    fisher,
    holm,
    mcnemar_exact,
    newcombe,
    stratified_permutation,
    trials_needed,
    wilson,
)

RATES = np.linspace(0.05, 0.95, 91)


@st.composite
def proportions(draw: st.DrawFn, most: int = 200) -> Proportion:
    trials = draw(st.integers(1, most))
    return Proportion(draw(st.integers(0, trials)), trials)


@settings(deadline=None)
@given(proportions())
def test_wilson_is_that_of_statsmodels(proportion: Proportion) -> None:
    low, high = proportion_confint(proportion.successes, proportion.trials, method="wilson")
    assert (wilson(proportion).low, wilson(proportion).high) == pytest.approx((low, high), abs=1e-12)


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
    """Chance that the interval of a sample holds the true rate, by counting every sample."""
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
    # It is known to dip at rates near 0 and 1, where few samples are possible.
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


def test_barnard_of_a_published_example_and_of_nothing_that_varies() -> None:
    # Mehta and Senchaudhuri (2003): 7/15 against 12/15, p = 0.0341 one-sided by the Wald statistic.
    assert barnard(Proportion(7, 15), Proportion(12, 15)) == pytest.approx(0.0682, abs=0.0005)
    assert barnard(Proportion(0, 15), Proportion(0, 15)) == 1.0
    assert math.isnan(barnard(Proportion(1, BARNARD_LIMIT + 1), Proportion(9, 15)))


@given(st.integers(0, 40), st.integers(0, 40))
def test_mcnemar_is_that_of_statsmodels(only_first: int, only_second: int) -> None:
    expected = statsmodels_mcnemar([[5, only_first], [only_second, 5]], exact=True).pvalue
    assert mcnemar_exact(only_first, only_second) == pytest.approx(min(1.0, expected))


def test_mcnemar_worked_by_hand() -> None:
    # Six discordant pairs, five for the first: 2 * (1 + 6) / 2**6.
    assert mcnemar_exact(5, 1) == pytest.approx(14 / 64)
    assert mcnemar_exact(0, 0) == 1.0


def test_the_permutation_test_worked_by_hand() -> None:
    # One position, 2/2 against 0/2: of the 6 ways to deal two successes among four, 2 are as uneven.
    one = Stratum(Proportion(2, 2), Proportion(0, 2))
    assert stratified_permutation([one]) == pytest.approx(2 / 6)
    # Two such positions: only the two dealings at the very ends are as uneven, 2 of 36.
    assert stratified_permutation([one, one]) == pytest.approx(2 / 36)
    # They cancel: nothing is less uneven.
    assert stratified_permutation([one, Stratum(one.second, one.first)]) == pytest.approx(1.0)
    assert stratified_permutation([]) == 1.0


STRATA = st.lists(st.builds(Stratum, proportions(3), proportions(3)), min_size=1, max_size=3)


@settings(deadline=None, max_examples=40)
@given(STRATA)
def test_the_permutation_test_counts_every_dealing(strata: list[Stratum]) -> None:
    outcomes = [
        [1] * (s.first.successes + s.second.successes) + [0] * (s.first.failures + s.second.failures) for s in strata
    ]
    dealt = [
        [sum(hand) for hand in itertools.combinations(cards, s.first.trials)]
        for cards, s in zip(outcomes, strata, strict=True)
    ]
    sums = np.array([sum(hands) for hands in itertools.product(*dealt)])
    expected = sums.mean()
    observed = sum(s.first.successes for s in strata)
    assert stratified_permutation(strata) == pytest.approx(
        np.mean(np.abs(sums - expected) >= abs(observed - expected) - 1e-9)
    )


def test_holm_is_that_of_statsmodels() -> None:
    random = np.random.default_rng(3)
    for size in (1, 2, 5, 8):
        p_values = (random.random(size) ** 3).tolist()
        assert holm(p_values) == pytest.approx(multipletests(p_values, method="holm")[1])


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_never_lowers_a_p_value_and_keeps_their_order(p_values: list[float]) -> None:
    adjusted = holm(p_values)
    assert all(p <= after <= 1 for p, after in zip(p_values, adjusted, strict=True))
    by_p = sorted(range(len(p_values)), key=lambda index: p_values[index])
    assert [adjusted[index] for index in by_p] == sorted(adjusted)


def test_the_trials_needed_give_the_power_asked_for() -> None:
    for first, second in [(0.3, 0.2), (0.29, 0.21), (0.6, 0.2), (0.05, 0.10)]:
        needed = trials_needed(first, second)
        assert needed is not None
        power = power_proportions_2indep(first - second, second, needed, alternative="two-sided").power
        assert power == pytest.approx(0.80, abs=0.02)
    assert trials_needed(0.3, 0.3) is None
    assert trials_needed(math.nan, 0.3) is None


def test_the_bootstrap_covers_the_difference_of_clustered_means() -> None:
    random = np.random.default_rng(7)
    clusters, episodes, held = 15, 5, 0
    samples = 300
    for sample in range(samples):
        place = random.normal(50, 15, clusters)  # hard positions are hard for both
        first = ClusterSums(
            (place[:, None] + 5 + random.normal(0, 10, (clusters, episodes))).sum(1), np.full(clusters, episodes)
        )
        second = ClusterSums(
            (place[:, None] + random.normal(0, 10, (clusters, episodes))).sum(1), np.full(clusters, episodes)
        )
        interval = clustered_bootstrap(first, second, shared_clusters=True, resamples=1000, seed=sample)
        held += 5 in interval
    assert 0.89 < held / samples < 0.98  # the percentile bootstrap of 15 clusters is a little short


def test_the_bootstrap_repeats_itself_and_knows_when_it_knows_nothing() -> None:
    few = ClusterSums(np.array([10.0]), np.array([2]))
    some = ClusterSums(np.array([10.0, 30.0, 20.0]), np.array([2, 2, 2]))
    assert clustered_bootstrap(few, some, shared_clusters=False) is UNKNOWN
    first = clustered_bootstrap(some, some, shared_clusters=False, seed=3)
    assert first == clustered_bootstrap(some, some, shared_clusters=False, seed=3)
    assert 0.0 in first
    with pytest.raises(ValueError, match="listed alike"):
        clustered_bootstrap(few, some, shared_clusters=True)


def test_successes_beyond_the_trials_are_refused() -> None:
    with pytest.raises(ValueError, match="3 successes of 2 trials"):
        Proportion(3, 2)
    assert math.isnan(wilson(Proportion(0, 0)).low)
    assert math.isnan(newcombe(Proportion(0, 0), Proportion(1, 2)).high)
