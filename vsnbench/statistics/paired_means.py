"""Paired comparison of a measure from 0 to 1, such as progress: difference, test and interval by starting position.

The test is that of `vsnbench.statistics.paired`: it flips the signs of whole starting positions, whatever the values.
The interval resamples whole starting positions (`vsnbench.statistics.bootstrap`), because Newcombe's is for rates only.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.bootstrap import MIN_CLUSTERS, ClusterSums, clustered_bootstrap
from vsnbench.statistics.permutation import sign_flip
from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval

_SAME = 1e-12


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
        return clustered_bootstrap(first, second, shared_clusters=True, confidence=confidence)

    def _sums(self, values: npt.NDArray[np.float64]) -> ClusterSums:
        _, places = np.unique(np.array(self.clusters, np.int64), return_inverse=True)
        return ClusterSums(np.asarray(np.bincount(places, weights=values), np.float64), np.bincount(places))
