"""Equivalence against statsmodels' two one-sided tests, and how often it is claimed wrongly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.stats.proportion import confint_proportions_2indep

from vsnbench.statistics.clustered import Cell, independent_outcomes
from vsnbench.statistics.equivalence import independent_equivalence, paired_equivalence
from vsnbench.statistics.paired import PairedCell, PairedOutcomes
from vsnbench.statistics.rates import Proportion


@settings(deadline=None)
@given(st.integers(0, 60), st.integers(0, 60), st.sampled_from([0.05, 0.15, 0.3]))
def test_independent_rates_are_equivalent_where_both_one_sided_tests_say_so(a: int, b: int, margin: float) -> None:
    found = independent_equivalence(
        independent_outcomes(Proportion(a, 60)), independent_outcomes(Proportion(b, 60)), margin
    )
    low, high = confint_proportions_2indep(a, 60, b, 60, method="newcomb", compare="diff", alpha=0.10)
    assert found.shown == (low > -margin and high < margin)
    assert found.excluded == (low > margin or high < -margin)


@pytest.mark.parametrize("concentration", [1.0, 1e6])
def test_models_as_far_apart_as_the_margin_are_called_equivalent_at_most_so_often_as_promised(
    concentration: float,
) -> None:
    random, claimed, right, samples = np.random.default_rng(5), 0, 0, 400
    for _ in range(samples):
        for rates, wrong in (((0.7, 0.5), True), ((0.6, 0.6), False)):
            wins = [random.binomial(5, random.beta(concentration * r, concentration * (1 - r), 60)) for r in rates]
            cells = zip(*wins, strict=True)
            outcomes = PairedOutcomes(
                tuple(PairedCell(Cell(s, int(a), 5), Cell(s, int(b), 5)) for s, (a, b) in enumerate(cells))
            )
            shown = paired_equivalence(outcomes, 0.2).shown
            claimed += shown and wrong
            right += shown and not wrong
    assert claimed / samples <= 0.07
    assert right / samples > 0.5


def test_a_margin_that_is_no_share_is_refused() -> None:
    with pytest.raises(ValueError, match="margin"):
        paired_equivalence(PairedOutcomes(()), 20)
