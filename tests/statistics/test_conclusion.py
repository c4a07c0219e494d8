import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.statistics.conclusion import Conclusion, DifferenceEvidence, conclude, winner_signs
from vsnbench.statistics.rates import UNKNOWN, Interval

share = st.floats(-1, 1)


@st.composite
def evidence(draw: st.DrawFn) -> DifferenceEvidence:
    """Return any evidence: an interval around its estimate, or none."""
    low, middle, high = sorted((draw(share), draw(share), draw(share)))
    interval = draw(st.sampled_from([Interval(low, high), UNKNOWN]))
    p = draw(st.none() | st.floats(0, 1))
    alpha, margin = draw(st.sampled_from([0.01, 0.05, 0.2])), draw(st.sampled_from([0.0, 0.1, 0.5]))
    return DifferenceEvidence(middle, interval, p, alpha, margin, complete=draw(st.booleans()))


def turned(known: DifferenceEvidence) -> DifferenceEvidence:
    """Return the same evidence of `second - first`."""
    interval = Interval(-known.interval.high, -known.interval.low)
    return DifferenceEvidence(-known.difference, interval, known.p, known.alpha, known.margin, known.complete)


@given(evidence())
def test_exchanging_the_two_exchanges_the_winner(known: DifferenceEvidence) -> None:
    assert conclude(turned(known)) is conclude(known).reversed


@given(evidence())
def test_a_winner_needs_the_test_the_interval_and_all_trials(known: DifferenceEvidence) -> None:
    found = conclude(known)
    rejects = known.p is None or known.p <= known.alpha
    outside = known.interval.known and (known.interval.low > known.margin or known.interval.high < -known.margin)
    assert found.names_winner == (known.complete and rejects and outside and known.difference != 0)
    if found.names_winner:
        assert found.sign == math.copysign(1, known.difference) == math.copysign(1, known.interval.low)


@given(st.lists(evidence(), min_size=1, max_size=5), st.sampled_from([0.01, 0.05]), st.sampled_from([0.0, 0.2]))
def test_arrays_of_evidence_give_the_same_winners(
    several: list[DifferenceEvidence], alpha: float, margin: float
) -> None:
    columns = np.array([(e.difference, e.interval.low, e.interval.high, e.p or 0.0) for e in several]).T
    single = [conclude(DifferenceEvidence(e.difference, e.interval, e.p or 0.0, alpha, margin)).sign for e in several]
    assert winner_signs(*columns, alpha, margin).tolist() == single


@pytest.mark.parametrize(
    ("difference", "ends", "p", "margin", "found"),
    [
        (0.06, (-0.07, 0.164), 0.02, 0.0, Conclusion.TEST_ONLY),
        (1.0, (0.21, 1.0), 0.25, 0.0, Conclusion.INTERVAL_ONLY),
        (0.3, (0.1, 0.5), 0.01, 0.0, Conclusion.FIRST_BETTER),
        (-0.3, (-0.5, -0.1), 0.05, 0.0, Conclusion.SECOND_BETTER),
        (0.3, (0.1, 0.5), 0.01, 0.15, Conclusion.TEST_ONLY),
        (0.3, (0.0, 0.5), 0.01, 0.0, Conclusion.TEST_ONLY),
        (0.1, (-0.1, 0.3), 0.3, 0.0, Conclusion.NOT_SHOWN),
        (0.3, (math.nan, math.nan), 0.01, 0.0, Conclusion.TEST_ONLY),
        (math.nan, (math.nan, math.nan), 1.0, 0.0, Conclusion.INCOMPLETE),
    ],
)
def test_conclusions_of_exact_cases(
    difference: float, ends: tuple[float, float], p: float, margin: float, found: Conclusion
) -> None:
    assert conclude(DifferenceEvidence(difference, Interval(*ends), p, 0.05, margin)) is found
