"""Success rates of independent trials: intervals, and the exact tests of two rates, as pure functions of counts.

None of this is in the paper, which prints bare percentages of 15 trials a category. Sources: Wilson (1927); Newcombe,
"Interval estimation for the difference between independent proportions", method 10 (1998); Zou and Donner (2008), who
named the recovery of an interval of a difference from those of its parts; Fisher; Barnard (1945); McNemar (1947).
Where several episodes share a starting position, `vsnbench.statistics.clustered` is to be used.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.student import student_quantile

CONFIDENCE = 0.95
POWER = 0.80


@dataclass(frozen=True, slots=True)
class Interval:
    """A confidence interval; both ends are NaN when there is nothing to estimate from."""

    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    @property
    def known(self) -> bool:
        """Whether there was anything to estimate from."""
        return math.isfinite(self.low) and math.isfinite(self.high)


UNKNOWN = Interval(math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Proportion:
    """Successes out of trials."""

    successes: int
    trials: int

    def __post_init__(self) -> None:
        if not 0 <= self.successes <= self.trials:
            raise ValueError(f"{self.successes} successes of {self.trials} trials cannot be")

    @property
    def rate(self) -> float:
        """Share of successes, 0 to 1; NaN for no trials."""
        return self.successes / self.trials if self.trials else math.nan

    @property
    def failures(self) -> int:
        """Trials that did not succeed."""
        return self.trials - self.successes


def wilson(proportion: Proportion, confidence: float = CONFIDENCE) -> Interval:
    """Return Wilson's score interval of a proportion; unknown for no trials.

    Covers 91 to 98 % at 15 trials and nominal 95 %, as the true rate varies (its least between rates of 0.1 and 0.9).
    """
    if proportion.trials == 0:
        return UNKNOWN
    return wilson_at(proportion.rate, proportion.trials, confidence)


def wilson_at(rate: float, trials: float, confidence: float = CONFIDENCE, freedom: float = math.inf) -> Interval:
    """Return Wilson's interval of a rate that is worth so many independent trials, which need not be whole.

    Args:
        rate: estimate, 0 to 1.
        trials: effective number of independent trials, above 0.
        confidence: of the interval.
        freedom: degrees of freedom of Student's t that takes the place of the normal distribution.
    """
    from statistics import NormalDist

    quantile = NormalDist().inv_cdf(0.5 + confidence / 2)  # importing scipy.stats would take long
    if math.isfinite(freedom):
        quantile = student_quantile(freedom, 0.5 + confidence / 2)
    square = quantile * quantile / trials
    centre = (rate + square / 2) / (1 + square)
    reach = math.sqrt(rate * (1 - rate) * square + square * square / 4) / (1 + square)
    low, high = max(0.0, centre - reach), min(1.0, centre + reach)
    # At 0 and at n successes the bound is exactly 0 and 1; rounding must not move it past the rate itself.
    return Interval(0.0 if rate <= 0 else min(low, rate), 1.0 if rate >= 1 else max(high, rate))


def newcombe(first: Proportion, second: Proportion, confidence: float = CONFIDENCE) -> Interval:
    """Return Newcombe's interval of the difference `first - second` of two independent proportions."""
    if first.trials == 0 or second.trials == 0:
        return UNKNOWN
    return difference_interval(first.rate, wilson(first, confidence), second.rate, wilson(second, confidence))


def difference_interval(
    first: float, around_first: Interval, second: float, around_second: Interval, correlation: float = 0.0
) -> Interval:
    """Return the interval of `first - second` that follows from an interval of each (Zou and Donner 2008).

    Args:
        first: an estimate.
        around_first: its interval.
        second: the other estimate.
        around_second: its interval.
        correlation: of the two estimates, -1 to 1; 0 where they are independent.
    """
    if not (around_first.known and around_second.known):
        return UNKNOWN

    def reach(down: float, up: float) -> float:
        return math.sqrt(max(0.0, down * down + up * up - 2 * correlation * down * up))

    difference = first - second
    below = reach(first - around_first.low, around_second.high - second)
    above = reach(around_first.high - first, second - around_second.low)
    return Interval(max(-1.0, difference - below), min(1.0, difference + above))


def fisher(first: Proportion, second: Proportion) -> float:
    """Return the two-sided p-value of Fisher's exact test; 1 when either has no trials. At most 5 % are below 0.05."""
    if first.trials == 0 or second.trials == 0:
        return 1.0
    from scipy.stats import fisher_exact

    return float(fisher_exact(_table(first, second)).pvalue)


def barnard(first: Proportion, second: Proportion) -> float:
    """Return the two-sided p-value of Barnard's exact test: more powerful than Fisher's, no margin is fixed.

    Its cost grows with the product of the two numbers of trials: above `BARNARD_LIMIT` trials a side the answer is
    NaN, and Fisher's test, which then says the same, is to be read.
    """
    if first.trials == 0 or second.trials == 0:
        return 1.0
    if max(first.trials, second.trials) > BARNARD_LIMIT:
        return math.nan
    if first.successes + second.successes in (0, first.trials + second.trials):
        return 1.0  # nothing varies: no table speaks against equality
    from scipy.stats import barnard_exact

    return float(barnard_exact(_table(first, second), alternative="two-sided").pvalue)


BARNARD_LIMIT = 400


def mcnemar_exact(only_first: int, only_second: int) -> float:
    """Return the two-sided p-value of McNemar's exact test on matched trials that do not resemble each other.

    Args:
        only_first: pairs in which only the first succeeded.
        only_second: pairs in which only the second succeeded.
    """
    discordant = only_first + only_second
    if discordant == 0:
        return 1.0
    from scipy.stats import binomtest

    return float(binomtest(only_first, discordant, 0.5).pvalue)


def _table(first: Proportion, second: Proportion) -> npt.NDArray[np.int64]:
    """Return the 2 x 2 table with a sample a column: scipy's Barnard fixes the column sums."""
    return np.array([[first.successes, second.successes], [first.failures, second.failures]])
