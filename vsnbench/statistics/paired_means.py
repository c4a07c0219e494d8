"""Paired comparison of a measure from 0 to 1, such as progress: difference, test and interval by starting position.

The test is that of `vsnbench.statistics.paired`: it flips the signs of whole starting positions, whatever the values.
Newcombe's interval is for rates only. The interval here is the hull of two: the bootstrap of whole starting positions
(`vsnbench.statistics.bootstrap`), which is too short where few positions differ, and the differences that the test does
not reject, which is too short where the differences are skewed. The latter ends at quantiles of the means of all
subsets of starting positions (Hartigan, "Using Subsample Values as Typical Values", 1969).
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.bootstrap import MIN_CLUSTERS, ClusterSums, clustered_bootstrap
from vsnbench.statistics.permutation import sign_flip
from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval

_SAME = 1e-12
_EXACT_UP_TO = 16
_SUBSETS = 65_536


@dataclass(frozen=True, slots=True)
class PairedMeans:
    """Mean values of two models in the same cells; one entry per cell."""

    clusters: tuple[int, ...]
    """Starting position of each cell."""
    first: tuple[float, ...]
    second: tuple[float, ...]

    def __post_init__(self) -> None:
        if not len(self.clusters) == len(self.first) == len(self.second):
            raise ValueError("each cell needs a starting position and a value of each model")

    @property
    def means(self) -> tuple[float, float]:
        """Mean of each model over the cells; NaN without cells."""
        cells = len(self.clusters)
        return (math.fsum(self.first) / cells, math.fsum(self.second) / cells) if cells else (math.nan, math.nan)

    @property
    def difference(self) -> float:
        """First mean minus the second."""
        return self.means[0] - self.means[1]

    def test(self) -> float:
        """Return the two-sided p-value of "the models are equally good at every starting position"."""
        sums = self._sums(np.array(self.first) - np.array(self.second)).totals
        return sign_flip([float(total) for total in sums])

    def interval(self, confidence: float = CONFIDENCE) -> Interval:
        """Return the interval of the difference; unknown with fewer than `MIN_CLUSTERS` starting positions.

        If every starting position shows the same difference, the interval is that difference: nothing varied.
        """
        first, second = self._sums(np.array(self.first)), self._sums(np.array(self.second))
        if len(first.counts) < MIN_CLUSTERS:
            return UNKNOWN
        apart = (first.totals - second.totals) / first.counts
        if np.ptp(apart) <= _SAME:
            return Interval(self.difference, self.difference)
        resampled = clustered_bootstrap(first, second, shared_clusters=True, confidence=confidence)
        low, high = _not_rejected(first.totals - second.totals, first.counts, 1 - confidence)
        return Interval(min(low, resampled.low), max(high, resampled.high))

    def _sums(self, values: npt.NDArray[np.float64]) -> ClusterSums:
        _, places = np.unique(np.array(self.clusters, np.int64), return_inverse=True)
        return ClusterSums(np.asarray(np.bincount(places, weights=values), np.float64), np.bincount(places))


def _not_rejected(totals: npt.NDArray[np.float64], counts: npt.NDArray[np.int64], alpha: float) -> tuple[float, float]:
    """Return the smallest and the largest mean that flipping the signs of whole clusters does not reject.

    Against a mean m, the flips that are at least as extreme on one side are the subsets of clusters whose own mean is
    at most m. All subsets up to `_EXACT_UP_TO` clusters, else `_SUBSETS` random ones.
    """
    if len(totals) <= _EXACT_UP_TO:
        sums, sizes = np.zeros(1), np.zeros(1)
        for total, count in zip(totals, counts, strict=True):
            sums, sizes = np.concatenate((sums, sums + total)), np.concatenate((sizes, sizes + count))
    else:
        chosen = np.random.default_rng(0).integers(0, 2, (_SUBSETS, len(totals))).astype(np.float64)
        sums, sizes = chosen @ totals, chosen @ counts
    means = np.sort(sums[sizes > 0] / sizes[sizes > 0])
    rank = min(max(math.floor(alpha / 2 * (len(means) + 1)), 1), len(means)) - 1
    return float(means[rank]), float(means[len(means) - 1 - rank])
