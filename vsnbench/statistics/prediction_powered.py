"""The real success rate from few real trials and all simulated ones of the same cells: prediction-powered, tuned.

Angelopoulos, Duchi and Zrnic, "PPI++: Efficient Prediction-Powered Inference" (2023): the simulator's outcome of a cell
predicts the real one; its mean over the cells without real trials is corrected by how wrong it was where there are
some, and `tuning`, 0 to 1, is how much it is trusted, chosen to make the variance least. Whatever the simulator is
worth, the estimate is right on average. Never the headline: it stands beside the plain estimate, with what it saved.

The point and the tuning are those of the paper. The interval is not its normal one, which is short for few trials and
rates near 0 or 1: the variance is that of whole starting positions, never less than if every cell had been driven for
real, and goes into Wilson's interval with Student's t. Coverage by simulation is in `docs/statistics.md`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.clustered import Cell, Outcomes, arrays, effective_sample
from vsnbench.statistics.rates import CONFIDENCE, Interval, wilson_at

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PredictedCell:
    """A cell that was driven for real, and the simulator's success rate in it, 0 to 1."""

    real: Cell
    predicted: float


@dataclass(frozen=True, slots=True)
class OnlyPredicted:
    """A cell with simulated trials alone: its starting position, and the simulator's success rate in it."""

    cluster: int
    predicted: float


@dataclass(frozen=True, slots=True)
class Powered:
    """What the simulator makes of few real trials, beside what they say alone; rates are means over cells."""

    rate: float
    interval: Interval
    plain_rate: float
    plain_interval: Interval
    tuning: float
    """How far the simulator is trusted: 0 not at all, 1 fully."""
    cells: int
    """With real trials."""
    worth: float
    """How many such cells, driven for real alone, would give as small a variance; at least about `cells`."""

    @property
    def saved(self) -> float:
        """Cells that did not have to be driven for real; never below 0."""
        return max(0.0, self.worth - self.cells)


def powered(
    driven: Sequence[PredictedCell], others: Sequence[OnlyPredicted], confidence: float = CONFIDENCE
) -> Powered | None:
    """Return the prediction-powered success rate over all cells, real and not.

    Args:
        driven: the cells with real trials, chosen without looking at the simulator's outcomes.
        others: the cells with simulated trials alone.
        confidence: of the intervals.

    Returns:
        None with fewer than three real cells, of fewer than three positions, or none left to predict: there is nothing
        to tune by, or to gain.
    """
    if len(driven) < 3 or not others or len({each.real.cluster for each in driven}) < 3:
        return None
    outcomes = Outcomes(tuple(each.real for each in driven))
    _, real, _ = arrays(outcomes.cells)
    predicted = np.array([each.predicted for each in driven])
    elsewhere = np.array([each.predicted for each in others])
    starts = [*(each.real.cluster for each in driven), *(each.cluster for each in others)]
    _, clusters = np.unique(starts, return_inverse=True)
    plain = effective_sample(outcomes, by_cell=True)
    tuning = best_tuning(real, predicted, elsewhere)
    left = _variance_left(real, predicted, elsewhere, clusters, tuning)
    everything = len(driven) + len(others)
    # As if each cell had been driven is the most that any simulator can be worth.
    gain = min(everything / len(driven), 1 / left) if left > 0 else everything / len(driven)
    freedom = min(plain.freedom, float(len(driven) - 1))

    def at(rate: float) -> Interval:
        return wilson_at(rate, plain.trials * gain, confidence, freedom)

    plain_interval, shorter = plain.interval(confidence), at(plain.rate)
    if shorter.high - shorter.low >= plain_interval.high - plain_interval.low:
        return Powered(plain.rate, plain_interval, plain.rate, plain_interval, 0.0, len(driven), len(driven))
    rate = min(1.0, max(0.0, point(real, predicted, elsewhere, tuning)))
    return Powered(rate, at(rate), plain.rate, plain_interval, tuning, len(driven), len(driven) * gain)


def point(real: Floats, predicted: Floats, elsewhere: Floats, tuning: float) -> float:
    """Return the tuned estimate of the mean (PPI++, Section 2).

    Args:
        real: (n,) outcomes of the driven cells.
        predicted: (n,) the simulator's in the same cells.
        elsewhere: (N,) the simulator's in the other cells.
        tuning: 0 to 1.
    """
    return float(tuning * elsewhere.mean() + (real - tuning * predicted).mean())


def best_tuning(real: Floats, predicted: Floats, elsewhere: Floats) -> float:
    """Return the tuning that makes the variance least (PPI++, Section 6), held between 0 and 1; 0 without variation."""
    everywhere = np.concatenate([predicted, elsewhere])
    spread = float(np.var(everywhere, ddof=1))
    if spread <= 0:
        return 0.0
    together = float(np.cov(real, predicted, bias=True)[0, 1])
    return min(1.0, max(0.0, together / ((1 + len(real) / len(elsewhere)) * spread)))


def _variance_left(
    real: Floats, predicted: Floats, elsewhere: Floats, clusters: npt.NDArray[np.int64], tuning: float
) -> float:
    """Return the share of the plain estimate's variance that is left, each the larger of what cells and clusters tell.

    What fitting the tuning to so few clusters (or cells) hides is added, as to an adjusted R squared: a simulator that
    is worth nothing leaves 1 on average.
    """
    mine = clusters[: len(real)]
    plain = _variance(_parts(real), mine)
    if plain <= 0 or tuning <= 0:
        return 1.0
    # Cells with and without real trials may lie at one position: what they add is summed up before it is squared.
    parts = np.concatenate([_parts(real - tuning * predicted), _parts(tuning * elsewhere)])
    whole_clusters = plain > _variance(_parts(real), np.arange(len(real)))
    facts = len(set(mine.tolist())) if whole_clusters else len(real)
    return _variance(parts, clusters) / plain * (facts - 1) / (facts - 2)


def _parts(values: Floats) -> Floats:
    """Return what each value adds to the deviation of their mean."""
    return np.asarray((values - values.mean()) / len(values), np.float64)


def _variance(parts: Floats, clusters: npt.NDArray[np.int64]) -> float:
    """Return the variance of a sum of such parts, the larger of what cells and clusters tell."""
    sums = np.bincount(clusters, weights=parts)
    return max(float(parts @ parts), float(sums @ sums))
