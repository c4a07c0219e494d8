"""The statistics of success rates: intervals, tests, corrections and sample sizes, as pure functions of counts.

None of this is in the paper, which prints bare percentages of 15 trials a category. Sources: Wilson (1927); Newcombe,
"Interval estimation for the difference between independent proportions", method 10 (1998); McNemar (1947), exact;
Barnard (1945); Holm (1979); Cameron, Gelbach and Miller (2008) for resampling whole clusters.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

CONFIDENCE = 0.95
POWER = 0.80


@dataclass(frozen=True, slots=True)
class Interval:
    """A confidence interval; both ends are NaN when there is nothing to estimate from."""

    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


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
    """Return Wilson's score interval of a proportion; unknown for no trials."""
    n = proportion.trials
    if n == 0:
        return UNKNOWN
    z = _two_sided_z(confidence)
    rate = proportion.rate
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    # At 0 and at n successes the bound is exactly 0 and 1; rounding must not move it past the rate itself.
    low = 0.0 if proportion.successes == 0 else max(0.0, centre - half)
    high = 1.0 if proportion.failures == 0 else min(1.0, centre + half)
    return Interval(low, high)


def newcombe(first: Proportion, second: Proportion, confidence: float = CONFIDENCE) -> Interval:
    """Return Newcombe's interval of the difference `first - second` of two independent proportions."""
    if first.trials == 0 or second.trials == 0:
        return UNKNOWN
    a, b = wilson(first, confidence), wilson(second, confidence)
    difference = first.rate - second.rate
    below = math.hypot(first.rate - a.low, b.high - second.rate)
    above = math.hypot(a.high - first.rate, second.rate - b.low)
    return Interval(difference - below, difference + above)


def fisher(first: Proportion, second: Proportion) -> float:
    """Return the two-sided p-value of Fisher's exact test; 1 when either has no trials."""
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
    """Return the two-sided p-value of McNemar's exact test on matched trials.

    Args:
        only_first: pairs in which only the first succeeded.
        only_second: pairs in which only the second succeeded.
    """
    discordant = only_first + only_second
    if discordant == 0:
        return 1.0
    from scipy.stats import binomtest

    return float(binomtest(only_first, discordant, 0.5).pvalue)


@dataclass(frozen=True, slots=True)
class Stratum:
    """The outcomes of two models in one stratum (one starting position)."""

    first: Proportion
    second: Proportion


def stratified_permutation(strata: Sequence[Stratum]) -> float:
    """Return the exact two-sided p-value of permuting which model an episode belongs to, within each stratum.

    The statistic is the first model's number of successes. Within a stratum it is hypergeometric, and the sum over
    the strata is their convolution: no random permutations are drawn. How hard a starting position is cancels out.
    """
    from scipy.signal import fftconvolve
    from scipy.stats import hypergeom

    distribution: npt.NDArray[np.float64] = np.ones(1)
    observed, expected = 0, 0.0
    for stratum in strata:
        total = stratum.first.trials + stratum.second.trials
        successes = stratum.first.successes + stratum.second.successes
        if not stratum.first.trials or not stratum.second.trials:
            continue  # nobody to exchange with
        here = hypergeom(total, successes, stratum.first.trials).pmf(np.arange(stratum.first.trials + 1))
        convolve = fftconvolve if min(len(here), len(distribution)) > _FFT_FROM else np.convolve
        distribution = np.clip(convolve(distribution, here), 0.0, 1.0)
        observed += stratum.first.successes
        expected += stratum.first.trials * successes / total
    distance = np.abs(np.arange(len(distribution)) - expected)
    return float(min(1.0, distribution[distance >= abs(observed - expected) - 1e-9].sum()))


_FFT_FROM = 500


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return the p-values adjusted for being asked together, in the order given (Holm's step-down)."""
    order = sorted(range(len(p_values)), key=lambda index: p_values[index])
    adjusted = [1.0] * len(p_values)
    worst = 0.0
    for rank, index in enumerate(order):
        worst = max(worst, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = worst
    return tuple(adjusted)


@dataclass(frozen=True, slots=True)
class ClusterSums:
    """A measure summed within each cluster (starting position): `totals[i]` over `counts[i]` episodes."""

    totals: npt.NDArray[np.float64]
    counts: npt.NDArray[np.int64]

    @property
    def mean(self) -> float:
        """Mean over all episodes; NaN for none."""
        episodes = int(self.counts.sum())
        return float(self.totals.sum()) / episodes if episodes else math.nan


def clustered_bootstrap(
    first: ClusterSums,
    second: ClusterSums,
    *,
    shared_clusters: bool,
    confidence: float = CONFIDENCE,
    resamples: int = 10_000,
    seed: int = 0,
) -> Interval:
    """Return the percentile interval of the difference of means `first - second`, resampling whole clusters.

    Episodes from one starting position resemble each other; resampling them one by one would pretend to know more.

    Args:
        first: sums of one model by cluster.
        second: sums of the other.
        shared_clusters: the i-th cluster of both is the same starting position, and is drawn for both together.
        confidence: of the interval.
        resamples: how many times the clusters are drawn.
        seed: makes the answer repeatable.

    Returns:
        The interval; unknown when either has fewer than two clusters with episodes.
    """
    if shared_clusters and len(first.counts) != len(second.counts):
        raise ValueError("shared clusters must be listed alike for both models")
    if min(np.count_nonzero(first.counts), np.count_nonzero(second.counts)) < 2:
        return UNKNOWN
    random = np.random.default_rng(seed)
    drawn = _draws(random, len(first.counts), resamples)
    drawn_second = drawn if shared_clusters else _draws(random, len(second.counts), resamples)
    with np.errstate(invalid="ignore", divide="ignore"):
        differences = (drawn @ first.totals) / (drawn @ first.counts) - (drawn_second @ second.totals) / (
            drawn_second @ second.counts
        )
    differences = differences[np.isfinite(differences)]  # a draw may hold no episode of one model
    tail = (1 - confidence) / 2
    low, high = np.quantile(differences, [tail, 1 - tail])
    return Interval(float(low), float(high))


def trials_needed(
    first_rate: float, second_rate: float, *, power: float = POWER, confidence: float = CONFIDENCE
) -> int | None:
    """Return the trials that each model needs to tell the two rates apart; None when the rates are equal.

    Normal approximation for two independent proportions (Fleiss, Levin and Paik 2003, Eq. 4.14).
    """
    if not (math.isfinite(first_rate) and math.isfinite(second_rate)) or first_rate == second_rate:
        return None
    from scipy.stats import norm

    mean = (first_rate + second_rate) / 2
    spread = _two_sided_z(confidence) * math.sqrt(2 * mean * (1 - mean)) + float(norm.ppf(power)) * math.sqrt(
        first_rate * (1 - first_rate) + second_rate * (1 - second_rate)
    )
    return math.ceil((spread / (first_rate - second_rate)) ** 2)


def _draws(random: np.random.Generator, clusters: int, resamples: int) -> npt.NDArray[np.float64]:
    return random.multinomial(clusters, np.full(clusters, 1 / clusters), size=resamples).astype(np.float64)


def _two_sided_z(confidence: float) -> float:
    from statistics import NormalDist

    return NormalDist().inv_cdf(0.5 + confidence / 2)


def _table(first: Proportion, second: Proportion) -> npt.NDArray[np.int64]:
    """Return the 2 x 2 table with a sample a column: scipy's Barnard fixes the column sums."""
    return np.array([[first.successes, second.successes], [first.failures, second.failures]])
