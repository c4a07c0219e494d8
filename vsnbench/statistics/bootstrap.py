"""Bootstrap of whole clusters (starting positions) for the mean of a measure.

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
MIN_CLUSTERS = 8
"""With fewer there are too few distinct resamples: with 5 the interval would cover 89 %."""
_SAME = 1e-12


@dataclass(frozen=True, slots=True)
class ClusterSums:
    """A measure summed within each cluster: `totals[i]` over `counts[i]` episodes."""

    totals: Floats
    counts: npt.NDArray[np.int64]

    @property
    def mean(self) -> float:
        """Mean over all episodes; NaN if there are none."""
        episodes = int(self.counts.sum())
        return float(self.totals.sum()) / episodes if episodes else math.nan


def clustered_bootstrap(
    first: ClusterSums,
    second: ClusterSums,
    *,
    shared_clusters: bool,
    resamples: int = 10_000,
    seed: int = 0,
) -> Interval:
    """Return the percentile interval of the difference of means `first - second`, by resampling whole clusters.

    Episodes from one starting position are correlated, so resampling single episodes would give intervals that are too
    short. The percentiles are expanded for the small number of clusters (Hesterberg), as Student's t expands the normal
    quantile.

    Args:
        first: sums of one model by cluster.
        second: sums of the other model.
        shared_clusters: the i-th cluster of both is the same starting position, and both are drawn together.
        resamples: number of resamples.
        seed: seed of the resamples.

    Returns:
        The interval. Unknown if either model has fewer than `MIN_CLUSTERS` clusters with episodes, or if every
        resample gives the same difference.
    """
    if shared_clusters and len(first.counts) != len(second.counts):
        raise ValueError("shared clusters must have the same length for both models")
    clusters = int(min(np.count_nonzero(first.counts), np.count_nonzero(second.counts)))
    if clusters < MIN_CLUSTERS:
        return UNKNOWN
    drawn, drawn_second = _draws(len(first.counts), None if shared_clusters else len(second.counts), resamples, seed)
    with np.errstate(invalid="ignore", divide="ignore"):
        differences = (drawn @ first.totals) / (drawn @ first.counts) - (drawn_second @ second.totals) / (
            drawn_second @ second.counts
        )
    return percentile_interval(differences, clusters)


def cluster_draws(clusters: int, resamples: int = 10_000, seed: int = 0) -> Floats:
    """Return the number of times each cluster was drawn, (resamples, clusters)."""
    return _draws(clusters, None, resamples, seed)[0]


def percentile_interval(values: Floats, clusters: int) -> Interval:
    """Return the expanded percentile interval of a statistic; unknown if every resample gives the same value.

    Args:
        values: the statistic in each resample; NaN where a resample does not determine it.
        clusters: number of resampled clusters.
    """
    values = values[np.isfinite(values)]
    if not len(values) or np.ptp(values) <= _SAME:
        return UNKNOWN
    tail = _expanded_tail(clusters, CONFIDENCE)
    low, high = np.quantile(values, [tail, 1 - tail])
    return Interval(float(low), float(high))


def _expanded_tail(clusters: int, confidence: float) -> float:
    quantile = student_quantile(clusters - 1, 0.5 + confidence / 2)
    return NormalDist().cdf(-quantile * math.sqrt(clusters / (clusters - 1)))


@lru_cache(maxsize=1)
def _draws(first: int, second: int | None, resamples: int, seed: int) -> tuple[Floats, Floats]:
    """Return the number of times each cluster was drawn, (resamples, clusters), for two samples.

    With `second` None both use the same draws. Cached for the next measure of the same clusters, because drawing takes
    longer than the rest.
    """
    random = np.random.default_rng(seed)

    def draw(clusters: int) -> Floats:
        drawn = random.multinomial(clusters, np.full(clusters, 1 / clusters), size=resamples).astype(np.float64)
        drawn.setflags(write=False)
        return drawn

    mine = draw(first)
    return mine, mine if second is None else draw(second)
