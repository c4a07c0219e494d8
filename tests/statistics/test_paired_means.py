"""Paired means against brute force over all sign flips, and against what their interval must contain."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.statistics.bootstrap import MIN_CLUSTERS
from vsnbench.statistics.paired_means import PairedMeans

shares = st.floats(0, 1).map(lambda value: round(value, 3))


def paired(first: list[float], second: list[float], cells: int = 1) -> PairedMeans:
    return PairedMeans(tuple(place // cells for place in range(len(first))), tuple(first), tuple(second))


def flips(differences: list[float]) -> float:
    """Return the share of all sign flips whose sum is at least as extreme."""
    sums = [
        abs(sum(s * d for s, d in zip(signs, differences, strict=True)))
        for signs in itertools.product((1, -1), repeat=len(differences))
    ]
    return float(np.mean([total >= abs(sum(differences)) - 1e-9 for total in sums]))


@given(st.lists(st.tuples(shares, shares), min_size=2, max_size=8))
def test_the_test_flips_the_signs_of_whole_starting_positions(cells: list[tuple[float, float]]) -> None:
    found = paired([a for a, _ in cells], [b for _, b in cells], cells=2)
    by_start = [sum(a - b for a, b in cells[at : at + 2]) for at in range(0, len(cells), 2)]
    assert found.test() == pytest.approx(flips(by_start))
    assert found.difference == pytest.approx(np.mean([a - b for a, b in cells]))


def test_a_difference_that_the_test_does_not_reject_is_in_the_interval() -> None:
    random = np.random.default_rng(3)
    for _ in range(20):
        first, second = random.random(10), random.random(10) ** 2
        interval = paired(first.tolist(), second.tolist()).interval()
        for shift in np.linspace(-0.6, 0.9, 31):
            moved = (first - second - shift).tolist()
            if flips(moved) > 0.06:  # beyond a step of one subset
                assert interval.low - 1e-9 <= shift <= interval.high + 1e-9


def test_too_few_positions_have_no_interval_and_equal_differences_have_that_one() -> None:
    few = MIN_CLUSTERS - 1
    assert not paired([0.5] * few, [0.1] * few).interval().known
    same = paired([0.5] * 9, [0.25] * 9).interval()
    assert (same.low, same.high) == (0.25, 0.25)


def test_a_stricter_level_widens_the_interval() -> None:
    random = np.random.default_rng(0)
    found = paired(random.random(15).tolist(), random.random(15).tolist())
    wide, narrow = found.interval(0.99), found.interval(0.9)
    assert wide.low < narrow.low < found.difference < narrow.high < wide.high


def test_more_positions_than_all_subsets_can_be_tried_of_have_an_interval_too() -> None:
    random = np.random.default_rng(0)
    found = paired(random.random(40).tolist(), (random.random(40) * 0.5).tolist())
    assert found.interval().low < found.difference < found.interval().high
    assert found.interval().high - found.interval().low < 0.3


def test_nothing_has_no_mean_and_cells_must_fit() -> None:
    assert math.isnan(PairedMeans((), (), ()).difference)
    with pytest.raises(ValueError, match="starting position"):
        PairedMeans((1,), (0.5, 0.5), (0.5,))
