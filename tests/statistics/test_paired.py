"""The paired interval and test: special cases, effect of copies and order, and coverage."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test
from vsnbench.statistics.rates import UNKNOWN

PAIRS = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=3, max_size=40)


def singles(pairs: "list[tuple[bool, bool]]") -> PairedOutcomes:
    return PairedOutcomes(
        tuple(PairedCell(Cell(start, int(a), 1), Cell(start, int(b), 1)) for start, (a, b) in enumerate(pairs))
    )


def mcnemar_exact(only_first: int, only_second: int) -> float:
    """Return the two-sided p-value of McNemar's exact test."""
    discordant = only_first + only_second
    return float(binomtest(only_first, discordant).pvalue) if discordant else 1.0


def method_10(both: int, only_first: int, only_second: int, neither: int) -> tuple[float, float]:
    """Return Newcombe's method 10 as published (1998, paired data), from counts."""
    n, z = both + only_first + only_second + neither, 1.959963984540054

    def limits(successes: int) -> tuple[float, float]:
        centre, reach = 2 * successes + z * z, z * math.sqrt(z * z + 4 * successes * (n - successes) / n)
        return (centre - reach) / (2 * (n + z * z)), (centre + reach) / (2 * (n + z * z))

    first, second = both + only_first, both + only_second
    (l1, u1), (l2, u2) = limits(first), limits(second)
    margins = first * (n - first) * second * (n - second)
    cross = both * neither - only_first * only_second
    corrected = max(cross - n / 2, 0) if cross > 0 else cross
    phi = corrected / math.sqrt(margins) if margins else 0.0
    p1, p2 = first / n, second / n
    below = math.sqrt(max(0, (p1 - l1) ** 2 - 2 * phi * (p1 - l1) * (u2 - p2) + (u2 - p2) ** 2))
    above = math.sqrt(max(0, (u1 - p1) ** 2 - 2 * phi * (u1 - p1) * (p2 - l2) + (p2 - l2) ** 2))
    return max(-1.0, p1 - p2 - below), min(1.0, p1 - p2 + above)


@settings(deadline=None)
@given(PAIRS)
def test_with_one_episode_a_position_they_are_method_10_and_mcnemars_test(pairs: "list[tuple[bool, bool]]") -> None:
    outcomes = singles(pairs)
    counts = [sum((a, b) == kind for a, b in pairs) for kind in ((True, True), (True, False), (False, True))]
    interval = paired_interval(outcomes)
    assert (interval.low, interval.high) == pytest.approx(method_10(*counts, len(pairs) - sum(counts)), abs=1e-9)
    assert paired_test(outcomes) == pytest.approx(mcnemar_exact(counts[1], counts[2]))


@settings(deadline=None)
@given(PAIRS, st.integers(2, 7))
def test_copies_under_other_seeds_change_nothing(pairs: "list[tuple[bool, bool]]", copies: int) -> None:
    once = singles(pairs)
    often = PairedOutcomes(
        tuple(PairedCell(Cell(s, copies * a, copies), Cell(s, copies * b, copies)) for s, (a, b) in enumerate(pairs))
    )
    assert paired_test(often) == pytest.approx(paired_test(once))
    assert often.difference == pytest.approx(once.difference)
    before, after = paired_interval(once), paired_interval(often)
    assert (after.low, after.high) == pytest.approx((before.low, before.high), abs=1e-9)


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(1, 5), st.integers(0, 3), st.integers(0, 2)), min_size=1, max_size=20))
def test_uneven_cells_keep_the_difference_within_its_interval(cells: "list[tuple[int, int, int]]") -> None:
    outcomes = PairedOutcomes(tuple(PairedCell(Cell(s, a, 3), Cell(s, b, 2)) for s, a, b in cells))
    interval = paired_interval(outcomes)
    starts = {start for start, _, _ in cells}
    assert interval.known == ((len(starts) if len(starts) > 1 else len(cells)) >= 3)
    if interval.known:
        assert -1 <= interval.low <= outcomes.difference + 1e-12
        assert outcomes.difference - 1e-12 <= interval.high <= 1
    assert outcomes.difference == pytest.approx(np.mean([a / 3 - b / 2 for _, a, b in cells]))


def exclusions(starts: int, rate: float) -> float:
    """Return the probability that the interval of two independent, equal models excludes 0, over all outcomes."""
    share = 0.0
    for pairs in itertools.product(itertools.product((True, False), repeat=2), repeat=starts):
        interval = method_10(
            *(sum(pair == kind for pair in pairs) for kind in itertools.product((True, False), repeat=2))
        )
        chance = math.prod(rate if success else 1 - rate for pair in pairs for success in pair)
        share += chance * (not interval[0] <= 0 <= interval[1])
    return share


def test_two_starting_positions_have_no_interval_as_it_would_exclude_0_too_often() -> None:
    assert exclusions(2, 0.5) == pytest.approx(0.125)
    assert paired_interval(singles([(True, False)] * 2)) == UNKNOWN
    assert all(exclusions(starts, 0.5) < 0.075 for starts in (3, 4, 5))
    assert paired_interval(singles([(True, False)] * 3)).low > 0.2


@pytest.mark.parametrize(("seeds", "concentration"), [(1, 1e6), (2, 1.0), (5, 0.02), (5, 1.0), (5, 4.0)])
def test_the_interval_covers_as_often_as_promised(seeds: int, concentration: float) -> None:
    random = np.random.default_rng(9)
    samples, held = 500, 0
    for _ in range(samples):
        wins = [
            random.binomial(seeds, random.beta(concentration * rate, concentration * (1 - rate), 15))
            for rate in (0.55, 0.3)
        ]
        outcomes = PairedOutcomes(
            tuple(
                PairedCell(Cell(s, int(a), seeds), Cell(s, int(b), seeds))
                for s, (a, b) in enumerate(zip(*wins, strict=True))
            )
        )
        held += 0.25 in paired_interval(outcomes)
    assert held / samples >= 0.925  # 93 %, minus the sampling error of 500 samples


def test_nothing_shared_is_nothing_known() -> None:
    assert paired_interval(PairedOutcomes(())) is UNKNOWN
    assert paired_test(PairedOutcomes(())) == 1.0
    assert math.isnan(PairedOutcomes(()).difference)
    with pytest.raises(ValueError, match="same cluster"):
        PairedCell(Cell(1, 0, 1), Cell(2, 0, 1))
