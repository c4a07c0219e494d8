"""Power equals statsmodels' and simulated power; required sample sizes reach the requested power."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom
from statsmodels.stats.power import TTestPower

from tests.statistics.test_paired import mcnemar_exact
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.paired import PairedCell, PairedOutcomes
from vsnbench.statistics.permutation import sign_flip
from vsnbench.statistics.power import (
    Design,
    Resemblance,
    design_of,
    detectable,
    least_p,
    min_starts,
    power,
    resemblance,
    starts_needed,
    trials_needed,
)

PLAIN = Design(starts=40, cells=1, trials=1, rate=0.4, resemblance=Resemblance(0.0, 0.0, 0.0))


def mcnemar_power(pairs: int, first: float, second: float) -> float:
    """Return the power of McNemar's exact test on independent pairs, by enumeration."""
    only_first, only_second = first * (1 - second), (1 - first) * second
    discordant = only_first + only_second
    return sum(
        float(binom.pmf(d, pairs, discordant) * binom.pmf(b, d, only_first / discordant))
        for d in range(pairs + 1)
        for b in range(d + 1)
        if mcnemar_exact(b, d - b) <= 0.05
    )


@pytest.mark.parametrize("difference", [0.1, 0.25, 0.4])
def test_of_single_episodes_it_is_the_exact_power_of_mcnemars_test(difference: float) -> None:
    expected = mcnemar_power(40, 0.4 + difference / 2, 0.4 - difference / 2)
    assert power(PLAIN, difference) == pytest.approx(expected, abs=0.06)  # 600 samples


def test_of_many_positions_it_is_that_of_students_t() -> None:
    many = Design(starts=200, cells=1, trials=1, rate=0.5, resemblance=Resemblance(0.0, 0.0, 0.0))
    spread = np.sqrt(0.55 * 0.45 * 2)
    assert power(many, 0.1) == pytest.approx(TTestPower().power(0.1 / spread, 200, 0.05), abs=0.06)


def test_no_difference_is_found_no_oftener_than_the_level() -> None:
    for alike in (Resemblance(0.0, 0.0, 0.0), Resemblance(0.3, 0.6, 0.4), Resemblance(0.1, 1.0, 0.0)):
        design = Design(starts=15, cells=5, trials=2, rate=0.4, resemblance=alike)
        assert power(design, 0.0) <= 0.07


def test_copies_of_a_deterministic_policy_add_no_power_and_new_positions_do() -> None:
    stubborn = Design(starts=15, cells=1, trials=1, rate=0.4, resemblance=Resemblance(0.0, 1.0, 0.0))
    assert power(replace(stubborn, trials=10), 0.3) == pytest.approx(power(stubborn, 0.3), abs=0.06)
    assert power(replace(stubborn, starts=60), 0.3) > power(stubborn, 0.3) + 0.3
    assert trials_needed(stubborn, 0.3) is None
    assert starts_needed(stubborn, 0.3) is not None


def test_what_is_said_to_be_needed_gives_the_power_at_the_level_in_force() -> None:
    strict = replace(PLAIN, level=0.05 / 9)
    needed = starts_needed(strict, 0.25)
    assert needed is not None
    assert needed > (starts_needed(PLAIN, 0.25) or 0)
    for seed in (1, 2):  # other random draws than those of the search
        assert power(replace(strict, starts=needed), 0.25, seed) == pytest.approx(0.80, abs=0.06)
    shown = detectable(PLAIN)
    assert shown is not None
    assert power(PLAIN, shown, 3) == pytest.approx(0.80, abs=0.07)


def test_the_resemblance_of_simulated_outcomes_is_found_again() -> None:
    random = np.random.default_rng(6)
    cells = []
    for start in range(400):
        hard = random.beta(1, 1)  # common effect of a position on both models: correlation of outcomes 1/3
        wins = random.binomial(2, hard, (3, 2))
        cells += [PairedCell(Cell(start, int(a), 2), Cell(start, int(b), 2)) for a, b in wins]
    found = resemblance(PairedOutcomes(tuple(cells)))
    assert (found.start, found.cell, found.models) == pytest.approx((1 / 3, 1 / 3, 1), abs=0.06)
    assert not found.assumed
    once = design_of(PairedOutcomes((PairedCell(Cell(1, 1, 1), Cell(1, 0, 1)),)), 0.05)
    assert once.resemblance.assumed
    assert (once.starts, once.cells, once.trials) == (1, 1, 1)


def test_the_least_p_value_is_that_of_the_most_one_sided_outcome() -> None:
    for starts in (1, 4, 5, 6, 11):
        assert least_p(starts) == pytest.approx(sign_flip([1.0] * starts))
    assert min_starts(0.05) == 6
    assert least_p(min_starts(0.01)) < 0.01 <= least_p(min_starts(0.01) - 1)
    five = Design(starts=5, cells=3, trials=1, rate=0.5, resemblance=Resemblance(0.1, 0.5, 0.0))
    assert detectable(five) is None
