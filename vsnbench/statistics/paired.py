"""Paired comparison of two models in the same cells: difference, interval and test.

Each model's outcomes are averaged within a cell; the difference is the mean over the cells, with equal weights. No
episode of a shared cell is dropped, whichever seeds the models were run with. The test flips the signs of the
differences of whole starting positions (Fisher's randomization of pairs; Winkler et al. 2015 for whole blocks); with
one episode of each model per starting position it is McNemar's exact test. The interval is Newcombe's method 10 for
paired proportions (1998) at the effective sample sizes.
"""

import math
from dataclasses import dataclass

import numpy as np

from vsnbench.statistics.clustered import (
    MIN_UNITS,
    Cell,
    EffectiveSample,
    Outcomes,
    arrays,
    effective_sample,
    few_clusters_correction,
    residual_variances,
    units_of,
)
from vsnbench.statistics.permutation import sign_flip
from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval, difference_interval


@dataclass(frozen=True, slots=True)
class PairedCell:
    """One cell that both models were tested in; both sides belong to the same cluster."""

    first: Cell
    second: Cell

    def __post_init__(self) -> None:
        if self.first.cluster != self.second.cluster:
            raise ValueError("both sides of a paired cell must belong to the same cluster")


@dataclass(frozen=True, slots=True)
class PairedOutcomes:
    """Cells that two models share."""

    cells: tuple[PairedCell, ...]

    @property
    def first(self) -> Outcomes:
        """The first model's outcomes."""
        return Outcomes(tuple(cell.first for cell in self.cells))

    @property
    def second(self) -> Outcomes:
        """The second model's outcomes."""
        return Outcomes(tuple(cell.second for cell in self.cells))

    @property
    def difference(self) -> float:
        """Mean over the cells of the first rate minus the second; NaN without cells."""
        if not self.cells:
            return math.nan
        return float(np.mean(arrays(self.first.cells)[1] - arrays(self.second.cells)[1]))

    def cluster_differences(self, beyond: float = 0.0) -> list[float]:
        """Return the sum of each cluster's differences beyond a tested one, over its cells, by cluster number."""
        if not self.cells:
            return []
        clusters, mine, _ = arrays(self.first.cells)
        theirs = arrays(self.second.cells)[1]
        return [float(total) for total in np.bincount(clusters, weights=mine - theirs - beyond)]


def paired_test(outcomes: PairedOutcomes) -> float:
    """Return the two-sided p-value of "the models are equally good at every starting position"; 1 without cells.

    The test holds its level whatever the correlation of the episodes of a starting position, because under the null
    hypothesis the two models are exchangeable at each position.
    """
    return sign_flip(outcomes.cluster_differences())


def paired_interval(outcomes: PairedOutcomes, confidence: float = CONFIDENCE) -> Interval:
    """Return the interval of `PairedOutcomes.difference`; unknown with fewer than `clustered.MIN_UNITS` units."""
    if units_of(outcomes.first) < MIN_UNITS:
        return UNKNOWN
    first = effective_sample(outcomes.first, by_cell=True)
    second = effective_sample(outcomes.second, by_cell=True)
    correlation = _correlation(outcomes, first, second)
    return difference_interval(
        first.rate, first.interval(confidence), second.rate, second.interval(confidence), correlation
    )


def _correlation(outcomes: PairedOutcomes, first: EffectiveSample, second: EffectiveSample) -> float:
    """Return the correlation of the two rates, shrunk towards 0 as in Newcombe's method 10.

    It is computed from the variances of the rates and of their difference, each the larger of the values from cells and
    clusters. With one episode per cell it is the phi coefficient.
    """
    product = first.variance * second.variance
    if product <= 0:
        return 0.0
    clusters, mine, _ = arrays(outcomes.first.cells)
    differences = mine - arrays(outcomes.second.cells)[1]
    weights = np.full(len(differences), 1 / len(differences))
    if clusters.max() == 0:
        clusters = np.arange(len(differences))
    between_cells, between_clusters = residual_variances(clusters, weights, differences - differences.mean())
    if math.isfinite(first.freedom) or math.isfinite(second.freedom):
        between_clusters *= few_clusters_correction(clusters, weights)
    apart = max(between_cells, between_clusters)
    correlation = (first.variance + second.variance - apart) / (2 * math.sqrt(product))
    if correlation > 0:
        spread = math.sqrt(first.rate * (1 - first.rate) * second.rate * (1 - second.rate))
        correlation = max(0.0, correlation - 1 / (2 * min(first.trials, second.trials) * spread))
    return max(-1.0, min(1.0, correlation))
