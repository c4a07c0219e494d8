"""Two models in the same cells: the difference, its interval and its test, all on the same episodes.

Within a cell each model's outcomes are averaged; the difference is the mean over the cells, each weighing the same. So
no episode of a shared cell is dropped, whichever seeds either model was run under and in whatever order. The test flips
the sign of whole starting positions' differences (Fisher's randomization of pairs; Winkler et al. 2015 for whole
blocks); with one episode of each model a starting position it is McNemar's exact test. The interval is Newcombe's
method 10 for paired proportions (1998) at the effective sample sizes; there it is his own.
"""

import math
from dataclasses import dataclass

import numpy as np

from vsnbench.statistics.clustered import (
    FEWEST_UNITS,
    Cell,
    Outcomes,
    arrays,
    effective_sample,
    residual_variances,
    units_of,
)
from vsnbench.statistics.permutation import sign_flip
from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval, difference_interval


@dataclass(frozen=True, slots=True)
class PairedCell:
    """One cell in which both models were tried; both belong to the same cluster."""

    first: Cell
    second: Cell

    def __post_init__(self) -> None:
        if self.first.cluster != self.second.cluster:
            raise ValueError("the two sides of a cell must lie in one cluster")


@dataclass(frozen=True, slots=True)
class PairedOutcomes:
    """The cells that two models share."""

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
        """Mean over the cells of the first's rate less the second's; NaN for no cells."""
        if not self.cells:
            return math.nan
        return float(np.mean(arrays(self.first.cells)[1] - arrays(self.second.cells)[1]))

    def cluster_differences(self) -> list[float]:
        """Return, for each cluster, the sum over its cells of the first's rate less the second's."""
        if not self.cells:
            return []
        clusters, mine, _ = arrays(self.first.cells)
        theirs = arrays(self.second.cells)[1]
        return [float(each) for each in np.bincount(clusters, weights=mine - theirs)]


def paired_test(outcomes: PairedOutcomes) -> float:
    """Return the two-sided p-value of "the models do equally well wherever they start"; 1 for no cells.

    At most 5 % of equal models are found different at 0.05, however much the episodes of a position resemble each
    other: which model is which is then a coin's toss for each position.
    """
    return sign_flip(outcomes.cluster_differences())


def paired_interval(outcomes: PairedOutcomes, confidence: float = CONFIDENCE) -> Interval:
    """Return the interval of `PairedOutcomes.difference`; unknown for fewer than `clustered.FEWEST_UNITS` units."""
    if units_of(outcomes.first) < FEWEST_UNITS:
        return UNKNOWN
    first = effective_sample(outcomes.first, by_cell=True)
    second = effective_sample(outcomes.second, by_cell=True)
    return difference_interval(
        first.rate,
        first.interval(confidence),
        second.rate,
        second.interval(confidence),
        _correlation(outcomes),
    )


def _correlation(outcomes: PairedOutcomes) -> float:
    """Return the correlation of the two rates, with the correction that method 10 makes towards 0.

    From the variances of the rates and of their difference, each the larger of what cells and clusters tell; for one
    episode a cell it is the phi coefficient.
    """
    first = effective_sample(outcomes.first, by_cell=True)
    second = effective_sample(outcomes.second, by_cell=True)
    product = first.variance * second.variance
    if product <= 0:
        return 0.0
    clusters, mine, _ = arrays(outcomes.first.cells)
    differences = mine - arrays(outcomes.second.cells)[1]
    weights = np.full(len(differences), 1 / len(differences))
    if clusters.max() == 0:
        clusters = np.arange(len(differences))
    apart = max(residual_variances(clusters, weights, differences - differences.mean()))
    correlation = (first.variance + second.variance - apart) / (2 * math.sqrt(product))
    if correlation > 0:
        spread = math.sqrt(first.rate * (1 - first.rate) * second.rate * (1 - second.rate))
        correlation = max(0.0, correlation - 1 / (2 * min(first.trials, second.trials) * spread))
    return max(-1.0, min(1.0, correlation))
