"""Rates and means where episodes resemble each other: several episodes of a cell, several cells of a starting position.

A **cell** is a goal from a starting position; the starting positions are the **clusters**. Five seeds of a policy that
repeats itself are one fact five times, and an interval that takes them for five is too short. Here the variance is the
largest of three: as if all episodes were independent, between cells, between clusters. What it is worth in independent
trials (Kish's effective sample size) goes into Wilson's interval, with Student's t where the variance was estimated:
wherever clusters hold several cells, also where they happen to show no more than chance (Korn and Graubard), for of few
clusters that says little.

Coverage by simulation is in `docs/statistics.md`. Sources: Kish (1965); Korn and Graubard (1998).
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
"""How much the cells of a cluster are taken to resemble each other where all outcomes are alike: a correlation."""


@dataclass(frozen=True, slots=True)
class Cell:
    """The outcomes of one cell: which cluster it belongs to, and its successes out of trials, at least one."""

    cluster: int
    successes: int
    trials: int

    def __post_init__(self) -> None:
        if not 0 <= self.successes <= self.trials or not self.trials:
            raise ValueError(f"{self.successes} successes of {self.trials} trials cannot be a cell's")


@dataclass(frozen=True, slots=True)
class Outcomes:
    """The outcomes of one condition, cell by cell."""

    cells: tuple[Cell, ...]

    @property
    def proportion(self) -> Proportion:
        """Successes of trials over all cells."""
        return Proportion(sum(cell.successes for cell in self.cells), sum(cell.trials for cell in self.cells))

    @property
    def clusters(self) -> int:
        """How many clusters there are."""
        return len({cell.cluster for cell in self.cells})

    @property
    def repeated(self) -> bool:
        """Whether any cell holds more than one trial."""
        return any(cell.trials > 1 for cell in self.cells)

    @property
    def independent(self) -> bool:
        """Whether every trial has a cluster to itself."""
        return self.clusters == self.proportion.trials


def independent_outcomes(proportion: Proportion, after: int = 0) -> Outcomes:
    """Return outcomes of which only their number is known: each trial is a cell and a cluster of its own.

    Args:
        proportion: successes of trials.
        after: clusters are numbered downwards from below this, apart from starting positions, which are above 0.
    """
    return Outcomes(tuple(Cell(after - n - 1, int(n < proportion.successes), 1) for n in range(proportion.trials)))


@dataclass(frozen=True, slots=True)
class EffectiveSample:
    """An estimate, and how many independent trials it is worth."""

    rate: float
    trials: float
    """Not more than the episodes; need not be whole."""
    freedom: float
    """Degrees of freedom of what was estimated; infinite where nothing had to be."""

    @property
    def variance(self) -> float:
        """Of the rate."""
        return self.rate * (1 - self.rate) / self.trials

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """Wilson's interval at this size."""
        return wilson_at(self.rate, self.trials, confidence, self.freedom)


FEWEST_UNITS = 3
"""An interval of a difference needs so many starting positions: of two it holds the truth in as few as 87 of 100
experiments, and leaves 0 out in up to 12 of 100 in which there is no difference (docs/statistics.md)."""


def units_of(outcomes: Outcomes) -> int:
    """Return by how many things a sample is told apart from chance: its clusters, or the cells of one alone."""
    clusters = len({cell.cluster for cell in outcomes.cells})
    return clusters if clusters > 1 else len(outcomes.cells)


def rate_interval(outcomes: Outcomes, confidence: float = CONFIDENCE) -> Interval:
    """Return the interval of the success rate; with one episode a cluster it is Wilson's, exactly.

    Copies of every episode, under however many seeds, leave it as it was. Unknown for no trials.
    """
    if not outcomes.cells:
        return UNKNOWN
    return effective_sample(outcomes).interval(confidence)


def independent_difference(first: Outcomes, second: Outcomes, confidence: float = CONFIDENCE) -> Interval:
    """Return the interval of `first - second` of two separate samples; Newcombe's where nothing repeats.

    Unknown for no trials, and where both have fewer than `FEWEST_UNITS` units.
    """
    if not first.cells or not second.cells or max(units_of(first), units_of(second)) < FEWEST_UNITS:
        return UNKNOWN
    a, b = effective_sample(first), effective_sample(second)
    return difference_interval(a.rate, a.interval(confidence), b.rate, b.interval(confidence))


def effective_sample(outcomes: Outcomes, *, by_cell: bool = False) -> EffectiveSample:
    """Return what the outcomes are worth in independent trials.

    With one cluster alone its cells take the clusters' place, and one cell alone counts as one trial: how much its
    episodes resemble each other cannot be known. Where all outcomes are the same, neither can it of the cells of a
    cluster, and they are taken for half alike: all of 15 cells in 15 clusters are worth 15 trials, all of 75 are 25.

    Nor can it of few that are not. With k the cells' worth of the rarer outcome, the cells of a cluster are taken to be
    correlated by no less than 0.5 / (1 + k), the episodes of a cell by no less than 1 / (1 + k)²: one success in 75
    episodes of 15 cells is worth 20 trials, for its neighbour, none in 75, is worth 15.

    Args:
        outcomes: at least one cell.
        by_cell: every cell weighs the same, else every episode does.
    """
    clusters, means, trials = arrays(outcomes.cells)
    weights = np.full(len(trials), 1 / len(trials)) if by_cell else trials / trials.sum()
    if clusters.max() == 0:
        clusters = np.arange(len(trials))
    rate = float(weights @ means)
    rate = min(1.0, rate) if rate < 1 - _SAME else 1.0
    spread = rate * (1 - rate)
    by_cluster = np.bincount(clusters, weights=weights)
    rarer = len(trials) * min(rate, 1 - rate)
    alike = _ASSUMED / (1 + rarer)
    least = 1 - alike + alike * float((by_cluster @ by_cluster) / (weights @ weights))
    if spread < _SAME or len(trials) == 1:
        return EffectiveSample(rate, 1 / (least * float(weights @ weights)), math.inf)
    repeats_alike = 1 / (1 + rarer) ** 2
    alone = spread * float(weights**2 @ ((1 + (trials - 1) * repeats_alike) / trials))
    between_cells, between_clusters = residual_variances(clusters, weights, means - rate)
    # Where each cluster is one fact, nothing had to be estimated.
    agree = _all_agree(np.bincount(clusters, weights=weights * means) / by_cluster)
    freedom = math.inf if agree else float(clusters.max())
    return EffectiveSample(rate, spread / max(least * max(alone, between_cells), between_clusters), freedom)


def arrays(cells: Iterable[Cell]) -> tuple[npt.NDArray[np.int64], Floats, Floats]:
    """Return the clusters' indices from 0, the cells' means and their trials."""
    listed = list(cells)
    _, clusters = np.unique(np.array([cell.cluster for cell in listed]), return_inverse=True)
    trials = np.array([cell.trials for cell in listed], np.float64)
    return clusters, np.array([cell.successes for cell in listed], np.float64) / trials, trials


def residual_variances(clusters: npt.NDArray[np.int64], weights: Floats, residuals: Floats) -> tuple[float, float]:
    """Return the variance of a weighted mean as its cells tell it, and as whole clusters tell it.

    Args:
        clusters: (cells,) index of the cluster of each, from 0.
        weights: (cells,) their sum is 1.
        residuals: (cells,) mean of each less the weighted mean.
    """
    weighted = weights * residuals
    by_cluster = np.bincount(clusters, weights=weighted)
    return float(weighted @ weighted), float(by_cluster @ by_cluster)


def _all_agree(means: Floats) -> bool:
    return bool(np.all((means < _SAME) | (means > 1 - _SAME)))
