"""Permutation tests: full enumeration, special cases, and level."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import permutation_test
from statsmodels.stats.contingency_tables import cochrans_q

from tests.statistics.test_paired import mcnemar_exact
from tests.statistics.test_rates import proportions
from vsnbench.statistics.clustered import Cell, Outcomes, independent_outcomes
from vsnbench.statistics.permutation import (
    Stratum,
    exchange_clusters,
    exchange_models,
    fisher_effective,
    sign_flip,
    stratified_permutation,
)
from vsnbench.statistics.rates import Proportion, fisher

DIFFERENCES = st.lists(st.sampled_from([-1, -0.8, -0.5, -0.2, 0, 0.2, 0.4, 0.5, 1]), max_size=9)


@settings(deadline=None)
@given(DIFFERENCES)
def test_sign_flips_count_every_arrangement(differences: "list[float]") -> None:
    sums = [sum(s * d for s, d in zip(signs, differences, strict=True)) for signs in _signs(len(differences))]
    expected = np.mean([abs(each) >= abs(sum(differences)) - 1e-9 for each in sums])
    assert sign_flip(differences) == pytest.approx(expected)


def _signs(size: int) -> "list[tuple[int, ...]]":
    return list(itertools.product((1, -1), repeat=size))


def test_sign_flips_are_those_of_scipy() -> None:
    differences = [0.4, -0.2, 1.0, 0.6, 0.0, 0.8, -0.4, 0.2, 0.6]
    expected = permutation_test((differences,), np.sum, permutation_type="samples", n_resamples=np.inf)
    assert sign_flip(differences) == pytest.approx(float(expected.pvalue))


@given(st.integers(0, 60), st.integers(0, 60))
def test_of_single_episodes_they_are_mcnemars_exact_test(only_first: int, only_second: int) -> None:
    differences = [1.0] * only_first + [-1.0] * only_second + [0.0] * 7
    assert sign_flip(differences) == pytest.approx(mcnemar_exact(only_first, only_second))


def test_many_uneven_differences_are_drawn_and_agree_with_counting() -> None:
    random = np.random.default_rng(2)
    uneven = random.normal(0.12, 0.5, 40)
    drawn = sign_flip(uneven.tolist())
    counted = sign_flip(np.round(uneven, 2).tolist())  # hundredths: enumerated
    assert drawn == pytest.approx(counted, abs=0.02)
    assert drawn == sign_flip(uneven.tolist())


def test_exchanging_positions_is_fishers_test_where_nothing_repeats() -> None:
    first, second = Proportion(9, 15), Proportion(3, 12)
    a, b = (independent_outcomes(each) for each in (first, second))
    assert exchange_clusters(a, b) == fisher(first, second)
    assert fisher_effective(a, b) == fisher(first, second)
    assert exchange_clusters(a, Outcomes(())) == 1.0


def test_exchanging_positions_agrees_with_dealing_them_all() -> None:
    first = [(4, 5), (5, 5), (2, 5), (5, 5)]
    second = [(0, 5), (1, 5), (3, 5), (0, 5), (1, 5)]
    everyone = first + second
    deals = [
        abs(sum(everyone[i][0] for i in hand) / 20 - sum(everyone[i][0] for i in range(9) if i not in hand) / 25)
        for hand in itertools.combinations(range(9), 4)
    ]
    expected = np.mean([deal >= deals[0] - 1e-9 for deal in deals])
    a, b = (Outcomes(tuple(Cell(n, k, t) for n, (k, t) in enumerate(side))) for side in (first, second))
    assert exchange_clusters(a, b) == pytest.approx(expected, abs=0.01)


def test_copies_do_not_make_a_difference_significant() -> None:
    a, b = (Outcomes(tuple(Cell(s, 5 * (s < k), 5) for s in range(15))) for k in (9, 4))
    assert fisher_effective(a, b) == fisher(Proportion(9, 15), Proportion(4, 15))
    assert exchange_clusters(a, b) == pytest.approx(fisher(Proportion(9, 15), Proportion(4, 15)), abs=0.02)
    assert fisher(a.proportion, b.proportion) < 0.001


def test_dealing_models_counts_every_arrangement_and_is_cochrans_q() -> None:
    random = np.random.default_rng(8)
    few = random.binomial(3, 0.5, (5, 3)) / 3
    ways = [list(itertools.permutations(row)) for row in few]
    spreads = np.array([np.var(np.sum(deal, axis=0)) for deal in itertools.product(*ways)])
    assert exchange_models(few) == pytest.approx(np.mean(spreads >= np.var(few.sum(0)) - 1e-9), abs=0.015)
    many = (random.random((60, 3)) < [0.6, 0.5, 0.3]).astype(int)
    assert exchange_models(many) == pytest.approx(cochrans_q(many).pvalue, abs=0.01)
    assert exchange_models(np.ones((15, 3))) == 1.0


def test_two_models_dealt_are_signs_flipped() -> None:
    rates = np.array([[1, 0.2], [0.4, 0.6], [0.8, 0], [1, 1], [0.6, 0.2], [0.8, 0.6]])
    assert exchange_models(rates) == pytest.approx(sign_flip((rates[:, 0] - rates[:, 1]).tolist()))


@pytest.mark.parametrize("concentration", [0.02, 1.0, 4.0, 1e6])
def test_equal_models_are_found_different_at_most_so_often_as_promised(concentration: float) -> None:
    random = np.random.default_rng(4)
    samples, flipped, naive = 500, 0, 0
    for _ in range(samples):
        wins = [random.binomial(5, random.beta(concentration * 0.5, concentration * 0.5, 15)) for _ in range(2)]
        flipped += sign_flip(((wins[0] - wins[1]) / 5).tolist()) < 0.05
        naive += fisher(Proportion(int(wins[0].sum()), 75), Proportion(int(wins[1].sum()), 75)) < 0.05
    assert flipped / samples <= 0.06
    if concentration <= 1:
        assert naive / samples > 0.15


def test_the_permutation_test_worked_by_hand() -> None:
    # A position with 2/2 against 0/2: of the 6 assignments of two successes to four, 2 are as extreme.
    one = Stratum(Proportion(2, 2), Proportion(0, 2))
    assert stratified_permutation([one]) == pytest.approx(2 / 6)
    # Two such positions: only the two extreme assignments are as extreme, 2 of 36.
    assert stratified_permutation([one, one]) == pytest.approx(2 / 36)
    # They cancel: every assignment is at least as extreme.
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
