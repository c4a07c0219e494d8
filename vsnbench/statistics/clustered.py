"""Rates and means of correlated episodes: several episodes per cell, several cells per starting position.

A **cell** is a goal from a starting position; the starting positions are the **clusters**. Five seeds of a
deterministic policy are one observation repeated five times, and an interval that counts them as five is too short.
The variance here is the largest of three: assuming independent episodes, between cells, and between clusters (with the
correction for few clusters, CR1 of Cameron and Miller 2015). The number of independent trials with that variance
(Kish's effective sample size) enters Wilson's interval. Student's t replaces the normal quantile wherever clusters hold
several cells, even if they happen to vary no more than by chance (Korn and Graubard), because few clusters cannot show
that they do not vary.

Coverage by simulation is in `docs/statistics.md`. Sources: Kish (1965); Korn and Graubard (1998); Cameron and Miller,
"A Practitioner's Guide to Cluster-Robust Inference" (2015).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval, Proportion, difference_interval, wilson_at

Floats = npt.NDArray[np.float64]
_SAME = 1e-9
_ASSUMED = 0.5
"""Correlation of the cells of a cluster that is assumed if all outcomes are the same."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Successes and trials of one cell, and its cluster; at least one trial.

    For progress, `successes` is the sum of its values. Of values from 0 to 1 with a given mean, successes and failures
    vary most, so the intervals for rates are valid for their means, and long rather than short.
    """

    cluster: int
    successes: float
    """An integer for outcomes; any number from 0 to `trials` for values from 0 to 1."""
    trials: int

    def __post_init__(self) -> None:
        if not 0 <= self.successes <= self.trials or not self.trials:
            raise ValueError(f"a cell cannot have {self.successes} successes in {self.trials} trials")


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Outcomes of one condition, by cell."""

    cells: tuple[Cell, ...]

    @property
    def proportion(self) -> Proportion:
        """Successes and trials over all cells; only for outcomes, not for sums of other values."""
        return Proportion(round(sum(cell.successes for cell in self.cells)), sum(cell.trials for cell in self.cells))

    @property
    def clusters(self) -> int:
        """Number of clusters."""
        return len({cell.cluster for cell in self.cells})

    @property
    def repeated(self) -> bool:
        """Whether any cell holds more than one trial."""
        return any(cell.trials > 1 for cell in self.cells)

    @property
    def independent(self) -> bool:
        """Whether every trial is in a cluster of its own."""
        return self.clusters == self.proportion.trials


def independent_outcomes(proportion: Proportion, after: int = 0) -> Outcomes:
    """Return outcomes of which only the counts are known: each trial is a cell and a cluster of its own.

    Args:
        proportion: successes and trials.
        after: clusters are numbered downwards from below this number; starting positions have positive numbers.
    """
    return Outcomes(tuple(Cell(after - n - 1, int(n < proportion.successes), 1) for n in range(proportion.trials)))


@dataclass(frozen=True, slots=True)
class EffectiveSample:
    """An estimate and its effective number of independent trials."""

    rate: float
    trials: float
    """At most the number of episodes; may be fractional."""
    freedom: float
    """Degrees of freedom of the estimated variance; infinite if the variance was not estimated."""

    @property
    def variance(self) -> float:
        """Variance of the rate."""
        return self.rate * (1 - self.rate) / self.trials

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """Return Wilson's interval at the effective sample size."""
        return wilson_at(self.rate, self.trials, confidence, self.freedom)


MIN_UNITS = 3
"""Smallest number of starting positions for an interval of a difference. With two, the interval covers the truth in as
few as 87 % of experiments and excludes 0 in up to 12 % of those without a difference (docs/statistics.md)."""


def units_of(outcomes: Outcomes) -> int:
    """Return the number of independent units: clusters, or the cells of a single cluster."""
    return outcomes.clusters if outcomes.clusters > 1 else len(outcomes.cells)


def rate_interval(outcomes: Outcomes, confidence: float = CONFIDENCE) -> Interval:
    """Return the interval of the success rate; exactly Wilson's with one episode per cluster.

    Repeating every episode under further seeds does not change it. Unknown without trials.
    """
    if not outcomes.cells:
        return UNKNOWN
    return effective_sample(outcomes).interval(confidence)


def independent_difference(first: Outcomes, second: Outcomes, confidence: float = CONFIDENCE) -> Interval:
    """Return the interval of `first - second` of two independent samples; Newcombe's without repetitions.

    Unknown without trials, or if both have fewer than `MIN_UNITS` units.
    """
    if not first.cells or not second.cells or max(units_of(first), units_of(second)) < MIN_UNITS:
        return UNKNOWN
    a, b = effective_sample(first), effective_sample(second)
    return difference_interval(a.rate, a.interval(confidence), b.rate, b.interval(confidence))


def effective_sample(outcomes: Outcomes, *, by_cell: bool = False) -> EffectiveSample:
    """Return the effective number of independent trials.

    A single cluster is replaced by its cells. A single cell counts as one trial, because the correlation of its
    episodes cannot be estimated. If all outcomes are the same, the correlation within a cluster cannot be estimated
    either, and 0.5 is assumed: 15 cells in 15 clusters count as 15 trials, 75 cells in 15 clusters as 25.

    Nor can it be estimated from a few deviating outcomes. With k the expected number of clusters with the rarer outcome
    (clusters times its rate), the cells of a cluster have a correlation of at least 1 / (2 + k), and the episodes of a
    cell one of at least 1 / (1 + k)²: one success in 75 episodes of 15 cells counts as 20 trials, none in 75 as 15. The
    k is based on clusters rather than cells, because successes from one or two starting positions carry the same
    information about the correlation however many cells these positions hold.

    Args:
        outcomes: at least one cell.
        by_cell: give every cell the same weight instead of every episode.
    """
    clusters, means, trials = arrays(outcomes.cells)
    weights = np.full(len(trials), 1 / len(trials)) if by_cell else trials / trials.sum()
    if clusters.max() == 0:
        clusters = np.arange(len(trials))
    rate = float(weights @ means)
    rate = min(1.0, rate) if rate < 1 - _SAME else 1.0
    spread = rate * (1 - rate)
    by_cluster = np.bincount(clusters, weights=weights)
    concentration = float(by_cluster @ by_cluster)
    rarer = min(rate, 1 - rate) / concentration
    alike = 1 / (1 / _ASSUMED + rarer)
    least = 1 - alike + alike * concentration / float(weights @ weights)
    if spread < _SAME or len(trials) == 1:
        return EffectiveSample(rate, 1 / (least * float(weights @ weights)), math.inf)
    repeats_alike = 1 / (1 + rarer) ** 2
    alone = spread * float(weights**2 @ ((1 + (trials - 1) * repeats_alike) / trials))
    between_cells, between_clusters = residual_variances(clusters, weights, means - rate)
    # If every cluster is constant, the variance is not estimated.
    agree = _all_agree(np.bincount(clusters, weights=weights * means) / by_cluster)
    freedom = math.inf if agree else float(clusters.max())
    if not agree:
        between_clusters *= few_clusters_correction(clusters, weights)
    return EffectiveSample(rate, spread / max(least * max(alone, between_cells), between_clusters), freedom)


def few_clusters_correction(clusters: npt.NDArray[np.int64], weights: Floats) -> float:
    """Return the factor for the variance between clusters that accounts for the estimated mean.

    G / (G - 1) for G clusters of equal weight; the effective number of clusters replaces G for unequal weights.
    """
    by_cluster = np.bincount(clusters, weights=weights)
    return 1 / (1 - float(by_cluster @ by_cluster))


def arrays(cells: Iterable[Cell]) -> tuple[npt.NDArray[np.int64], Floats, Floats]:
    """Return the cluster index (from 0), the mean and the number of trials of each cell."""
    listed = list(cells)
    _, clusters = np.unique(np.array([cell.cluster for cell in listed]), return_inverse=True)
    trials = np.array([cell.trials for cell in listed], np.float64)
    return clusters, np.array([cell.successes for cell in listed], np.float64) / trials, trials


def residual_variances(clusters: npt.NDArray[np.int64], weights: Floats, residuals: Floats) -> tuple[float, float]:
    """Return the variance of a weighted mean from the cells and from whole clusters.

    Args:
        clusters: (cells,) cluster index of each cell, from 0.
        weights: (cells,) weights that sum to 1.
        residuals: (cells,) mean of each cell minus the weighted mean.
    """
    weighted = weights * residuals
    by_cluster = np.bincount(clusters, weights=weighted)
    return float(weighted @ weighted), float(by_cluster @ by_cluster)


def _all_agree(means: Floats) -> bool:
    return bool(np.all((means < _SAME) | (means > 1 - _SAME)))
