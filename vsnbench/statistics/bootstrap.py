"""Means of a measure where episodes resemble each other: the bootstrap of whole clusters (starting positions).

Sources: Cameron, Gelbach and Miller (2008) for resampling whole clusters; Hesterberg, "What Teachers Should Know About
the Bootstrap" (2015), for the expanded percentiles.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval
from vsnbench.statistics.student import student_quantile

Floats = npt.NDArray[np.float64]
FEWEST_CLUSTERS = 8
"""Of fewer there are too few different draws: with 5 the interval would cover 89 %."""


@dataclass(frozen=True, slots=True)
class ClusterSums:
    """A measure summed within each cluster (starting position): `totals[i]` over `counts[i]` episodes."""

    totals: Floats
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

    Episodes from one starting position resemble each other; resampling them one by one would pretend to know more. The
    percentiles are farther out by what a sample of so few clusters falls short of its population (Hesterberg's expanded
    ones): as Student's t is to the normal distribution.

    Args:
        first: sums of one model by cluster.
        second: sums of the other.
        shared_clusters: the i-th cluster of both is the same starting position, and is drawn for both together.
        confidence: of the interval.
        resamples: how many times the clusters are drawn.
        seed: makes the answer repeatable.

    Returns:
        The interval; unknown when either has fewer than `FEWEST_CLUSTERS` clusters with episodes.
    """
    if shared_clusters and len(first.counts) != len(second.counts):
        raise ValueError("shared clusters must be listed alike for both models")
    clusters = int(min(np.count_nonzero(first.counts), np.count_nonzero(second.counts)))
    if clusters < FEWEST_CLUSTERS:
        return UNKNOWN
    drawn, drawn_second = _draws(len(first.counts), None if shared_clusters else len(second.counts), resamples, seed)
    with np.errstate(invalid="ignore", divide="ignore"):
        differences = (drawn @ first.totals) / (drawn @ first.counts) - (drawn_second @ second.totals) / (
            drawn_second @ second.counts
        )
    differences = differences[np.isfinite(differences)]  # a draw may hold no episode of one model
    tail = _expanded_tail(clusters, confidence)
    low, high = np.quantile(differences, [tail, 1 - tail])
    return Interval(float(low), float(high))


def _expanded_tail(clusters: int, confidence: float) -> float:
    quantile = student_quantile(clusters - 1, 0.5 + confidence / 2)
    return NormalDist().cdf(-quantile * math.sqrt(clusters / (clusters - 1)))


@lru_cache(maxsize=1)
def _draws(first: int, second: int | None, resamples: int, seed: int) -> tuple[Floats, Floats]:
    """Return how often each cluster was drawn, (resamples, clusters), of two samples; None: the first's for both.

    Kept for the next measure of the same clusters: drawing takes longer than all the rest.
    """
    random = np.random.default_rng(seed)

    def draw(clusters: int) -> Floats:
        drawn = random.multinomial(clusters, np.full(clusters, 1 / clusters), size=resamples).astype(np.float64)
        drawn.setflags(write=False)
        return drawn

    mine = draw(first)
    return mine, mine if second is None else draw(second)
