"""The rule that names a winner.

A winner is named only if the test rejects "no difference", the interval excludes every difference up to the margin, and
both point in the same direction. Neither is enough alone. A sign-flip test over starting positions rejects too often if
the differences are skewed, and an interval from few starting positions can exclude 0 where no test of that design could
reject.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.rates import Interval

_ROUNDING = 1e-12


class Conclusion(StrEnum):
    """Conclusion about a difference `first - second`."""

    FIRST_BETTER = "first better"
    SECOND_BETTER = "second better"
    TEST_ONLY = "test only"
    """The test rejects, but the interval includes differences within the margin."""
    INTERVAL_ONLY = "interval only"
    """The interval excludes the margin, but the test does not reject."""
    EQUIVALENT = "equivalent"
    """The difference is smaller than the margin, in either direction."""
    NOT_INFERIOR = "not inferior"
    """The first is worse than the second by less than the margin, if at all."""
    NOT_SHOWN = "not shown"
    INCOMPLETE = "incomplete"
    """Too few of the planned trials are complete."""

    @property
    def sign(self) -> int:
        """1 if the first is better, -1 if the second is, 0 if no winner is named."""
        return {Conclusion.FIRST_BETTER: 1, Conclusion.SECOND_BETTER: -1}.get(self, 0)

    @property
    def reversed(self) -> "Conclusion":
        """The same conclusion about `second - first`."""
        turned = {Conclusion.FIRST_BETTER: Conclusion.SECOND_BETTER, Conclusion.SECOND_BETTER: Conclusion.FIRST_BETTER}
        return turned.get(self, self)

    @property
    def names_winner(self) -> bool:
        """Whether a winner is named."""
        return self.sign != 0


@dataclass(frozen=True, slots=True)
class DifferenceEvidence:
    """Estimate, interval and p-value of a difference `first - second`."""

    difference: float
    """The estimate; NaN without data."""
    interval: Interval
    p: float | None
    """Two-sided p-value, corrected for all comparisons; None if the interval is the test."""
    alpha: float = 0.05
    margin: float = 0.0
    """Difference that a winner must exceed, 0 or more; of equivalence, the one that the models must not reach."""
    complete: bool = True
    """Enough of the planned trials are complete for a conclusion."""


def conclude(evidence: DifferenceEvidence) -> Conclusion:
    """Return the conclusion that the evidence supports."""
    if not evidence.complete or math.isnan(evidence.difference):
        return Conclusion.INCOMPLETE
    interval, margin = evidence.interval, evidence.margin
    p = 0.0 if evidence.p is None else evidence.p
    sign = int(winner_signs(evidence.difference, interval.low, interval.high, p, evidence.alpha, margin))
    if sign:
        return Conclusion.FIRST_BETTER if sign > 0 else Conclusion.SECOND_BETTER
    if evidence.p is not None and p <= evidence.alpha + _ROUNDING:
        return Conclusion.TEST_ONLY
    return Conclusion.INTERVAL_ONLY if interval.low > margin or interval.high < -margin else Conclusion.NOT_SHOWN


def conclude_within(evidence: DifferenceEvidence, *, one_sided: bool = False) -> Conclusion:
    """Return whether the evidence shows equivalence, or that the first is not inferior.

    Two one-sided tests (Schuirmann 1987): the larger p-value must be at most alpha, and the two-sided interval, of
    confidence 1 - alpha, must lie within the margin. An interval of 1 - 2 alpha is not enough: where one model is near
    0 or 1, differences at the margin are skewed, and both the tests and that interval then err in up to 6.9 % of
    studies instead of 5 %. This is the convention for non-inferiority in clinical trials (ICH E9, Section 3.3.2).

    Args:
        evidence: `p` is the larger of the two one-sided p-values, or the only one.
        one_sided: non-inferiority: only that the first is worse by less than the margin.
    """
    if not evidence.complete or math.isnan(evidence.difference) or evidence.p is None:
        return Conclusion.INCOMPLETE
    interval, margin = evidence.interval, evidence.margin
    rejects = evidence.p <= evidence.alpha + _ROUNDING
    within = interval.low > -margin and (one_sided or interval.high < margin)
    if rejects and within:
        return Conclusion.NOT_INFERIOR if one_sided else Conclusion.EQUIVALENT
    if rejects:
        return Conclusion.TEST_ONLY
    return Conclusion.INTERVAL_ONLY if within else Conclusion.NOT_SHOWN


def winner_signs(
    difference: npt.ArrayLike, low: npt.ArrayLike, high: npt.ArrayLike, p: npt.ArrayLike, alpha: float, margin: float
) -> npt.NDArray[np.int8]:
    """Return 1 where the first is better, -1 where the second is, 0 where no winner is named.

    Args:
        difference: estimates of `first - second`.
        low: lower ends of their intervals; NaN where unknown.
        high: upper ends.
        p: two-sided p-values, corrected for all comparisons.
        alpha: largest p-value that rejects.
        margin: difference that a winner must exceed.
    """
    estimate, lower, upper = (np.asarray(values, np.float64) for values in (difference, low, high))
    rejects = np.asarray(p, np.float64) <= alpha + _ROUNDING
    above, below = (lower > margin) & (estimate > 0), (upper < -margin) & (estimate < 0)
    return np.asarray((rejects & above).astype(np.int8) - (rejects & below).astype(np.int8), np.int8)
