"""Array formulas for many samples against the formulas for a single sample."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.statistics.balanced import flip_p_values, paired_intervals, rate_intervals
from vsnbench.statistics.clustered import Cell, rate_interval
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test


def paired(first: np.ndarray, second: np.ndarray, trials: int) -> PairedOutcomes:
    """Return a sample in the report's format."""
    return PairedOutcomes(
        tuple(
            PairedCell(Cell(start, int(first[start, cell]), trials), Cell(start, int(second[start, cell]), trials))
            for start, cell in np.ndindex(first.shape)
        )
    )


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    starts=st.integers(3, 12),
    cells=st.integers(1, 4),
    trials=st.integers(1, 4),
    rates=st.tuples(st.sampled_from([0.0, 0.05, 0.4, 0.9, 1.0]), st.sampled_from([0.0, 0.1, 0.5, 0.95])),
    alike=st.booleans(),
)
def test_many_samples_at_once_give_the_numbers_of_one(
    seed: int, starts: int, cells: int, trials: int, rates: tuple[float, float], alike: bool
) -> None:
    random = np.random.default_rng(seed)
    shape = (4, starts, cells)
    chances = [random.random((4, starts, 1)) < rate if alike else np.full(shape, rate) for rate in rates]
    first, second = (random.binomial(trials, np.broadcast_to(chance, shape)) for chance in chances)
    found = paired_intervals(first / trials, second / trials, trials, 0.95)
    single = rate_intervals(first / trials, trials, 0.95)
    p = flip_p_values((first - second).sum(2) / trials)
    for place in range(4):
        outcomes = paired(first[place], second[place], trials)
        expected, own = paired_interval(outcomes), rate_interval(outcomes.first)
        assert found.estimate[place] == pytest.approx(outcomes.difference, abs=1e-9)
        assert (found.low[place], found.high[place]) == pytest.approx((expected.low, expected.high), abs=1e-7)
        assert (single.low[place], single.high[place]) == pytest.approx((own.low, own.high), abs=1e-9)
        assert p[place] == pytest.approx(paired_test(outcomes), abs=1e-9)
