"""Posteriors against statsmodels and against drawing from them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.stats.proportion import proportion_confint

from vsnbench.statistics.clustered import Cell, Outcomes, effective_sample, independent_outcomes
from vsnbench.statistics.posterior import Posterior, posterior, probability_better
from vsnbench.statistics.rates import Proportion


@settings(deadline=None)
@given(st.integers(1, 20), st.integers(0, 20))
def test_the_interval_is_jeffreys(successes: int, failures: int) -> None:
    believed = posterior(effective_sample(independent_outcomes(Proportion(successes, successes + failures))))
    low, high = proportion_confint(successes, successes + failures, method="jeffreys")
    interval = believed.interval()
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=1e-9)
    assert interval.low < believed.mean < interval.high


def test_copies_of_a_cell_make_nobody_surer() -> None:
    once = posterior(effective_sample(Outcomes(tuple(Cell(s, int(s < 9), 1) for s in range(15)))))
    often = posterior(effective_sample(Outcomes(tuple(Cell(s, 5 * (s < 9), 5) for s in range(15)))))
    assert (often.a, often.b) == pytest.approx((once.a, once.b))


@pytest.mark.parametrize("by", [0.0, 0.1])
def test_the_probability_of_being_better_is_that_of_drawing_it(by: float) -> None:
    random = np.random.default_rng(1)
    first, second = Posterior(9.5, 6.5), Posterior(6.5, 9.5)
    drawn = random.beta(9.5, 6.5, 400_000) - random.beta(6.5, 9.5, 400_000)
    assert probability_better(first, second, by) == pytest.approx(np.mean(drawn > by), abs=0.003)
    assert probability_better(first, first) == pytest.approx(0.5, abs=1e-3)
    assert probability_better(first, second) + probability_better(second, first) == pytest.approx(1, abs=1e-3)
