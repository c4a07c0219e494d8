"""Power of two samples: Fisher's by enumeration, exchanged positions by the test."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from vsnbench.statistics.clustered import Cell, Outcomes
from vsnbench.statistics.permutation import exchange_clusters
from vsnbench.statistics.power import Resemblance
from vsnbench.statistics.power_independent import (
    ExchangeDesign,
    _fisher_power,
    _fisher_rejects,
    exchange_design_of,
    exchange_detectable,
    exchange_power,
    exchange_starts_needed,
    independent_detectable,
    independent_trials_needed,
    least_exchange_p,
    min_exchanged_starts,
)
from vsnbench.statistics.rates import Proportion, fisher

APART = ExchangeDesign(starts=(8, 10), cells=3, trials=1, rate=0.4, resemblance=Resemblance(0.2, 0.5, 0.0))


def independent_power(n: int, m: int, first: float, second: float) -> float:
    return _fisher_power(_fisher_rejects(n, m, 0.05), first, second)


@settings(deadline=None, max_examples=25)
@given(st.integers(2, 14), st.integers(2, 14), st.floats(0.05, 0.95), st.floats(0.05, 0.95))
def test_power_of_independent_samples_counts_every_table(n: int, m: int, first: float, second: float) -> None:
    expected = sum(
        float(binom.pmf(a, n, first) * binom.pmf(b, m, second))
        for a in range(n + 1)
        for b in range(m + 1)
        if fisher(Proportion(a, n), Proportion(b, m)) <= 0.05
    )
    assert independent_power(n, m, first, second) == pytest.approx(expected, abs=1e-9)


def test_independent_trials_needed_give_the_exact_power_asked_for() -> None:
    for first, second in [(0.3, 0.2), (0.29, 0.21), (0.6, 0.2)]:
        needed = independent_trials_needed(first, second, 0.05)
        assert needed is not None
        assert independent_power(needed, needed, first, second) == pytest.approx(0.80, abs=0.04)
    assert independent_trials_needed(0.3, 0.3, 0.05) is None
    assert independent_trials_needed(float("nan"), 0.3, 0.05) is None
    shown = independent_detectable(75, 90, 0.25, 0.05)
    assert shown is not None
    assert independent_power(75, 90, 0.25 + shown / 2, 0.25 - shown / 2) >= 0.8


def test_the_power_of_exchanging_positions_equals_the_tests_rejection_rate() -> None:
    random, found, samples = np.random.default_rng(3), 0, 250
    for _ in range(samples):
        sides = []
        for rate, starts in ((0.6, 8), (0.2, 10)):
            chances = random.beta(4 * rate, 4 * (1 - rate), starts)  # correlation of a position's episodes: 0.2
            wins = random.random((3, starts)) < chances
            sides.append(Outcomes(tuple(Cell(s, int(wins[g, s]), 1) for g in range(3) for s in range(starts))))
        found += exchange_clusters(sides[0], sides[1], draws=999) <= 0.05
    assert exchange_power(APART, 0.4) == pytest.approx(found / samples, abs=0.09)
    assert exchange_power(APART, 0.0) <= 0.07


def test_two_against_three_positions_can_show_nothing_and_the_least_p_says_so() -> None:
    two, three = (Outcomes(tuple(Cell(s, won, 5) for s in range(n))) for n, won in ((2, 5), (3, 0)))
    assert exchange_clusters(two, three) == pytest.approx(least_exchange_p(2, 3), abs=0.01)
    assert least_exchange_p(2, 3) == pytest.approx(0.1)
    for n, m in [(2, 3), (3, 3), (4, 4), (3, 7)]:
        assert fisher(Proportion(n, n), Proportion(0, m)) == pytest.approx(least_exchange_p(n, m))
    assert min_exchanged_starts(0.05) == 4
    design = exchange_design_of(two, three, 0.05)
    assert (design.starts, design.trials) == ((2, 3), 5)
    assert exchange_detectable(design) is None


def test_the_positions_said_to_be_needed_give_the_power_asked_for() -> None:
    needed = exchange_starts_needed(APART, 0.3)
    assert needed is not None
    assert exchange_power(replace(APART, starts=(needed, needed)), 0.3, seed=1) == pytest.approx(0.8, abs=0.07)
    shown = exchange_detectable(APART)
    assert shown is not None
    assert exchange_power(APART, shown, seed=2) == pytest.approx(0.8, abs=0.07)
