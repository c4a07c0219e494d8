"""Prediction-powered estimate of the real success rate from few real and many simulated trials of the same cells.

Angelopoulos, Duchi and Zrnic, "PPI++: Efficient Prediction-Powered Inference" (2023): the simulated outcome of a cell
predicts the real one. The mean prediction over the cells without real trials is corrected by the prediction error in
the cells with real trials. `tuning`, 0 to 1, is the weight of the predictions and minimizes the variance. The estimate
is unbiased however poor the simulator is.

The point estimate and the tuning are those of the paper. The paper's normal interval is too short for few trials and
rates near 0 or 1. This one uses the variance of whole starting positions, never less than if every cell had real
trials, in Wilson's interval with Student's t. Coverage by simulation is in `docs/statistics.md`.
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
    """A cell with real trials, and its simulated success rate, 0 to 1."""

    real: Cell
    predicted: float


@dataclass(frozen=True, slots=True)
class OnlyPredicted:
    """A cell with simulated trials only: its starting position and simulated success rate."""

    cluster: int
    predicted: float


@dataclass(frozen=True, slots=True)
class Powered:
    """Prediction-powered and plain estimates of a success rate; rates are means over cells."""

    rate: float
    interval: Interval
    plain_rate: float
    plain_interval: Interval
    tuning: float
    """Weight of the simulated outcomes, 0 to 1."""
    cells: int
    """Number of cells with real trials."""
    worth: float
    """Effective number of cells with real trials."""

    @property
    def saved(self) -> float:
        """Number of real cells saved by the simulation; at least 0."""
        return max(0.0, self.worth - self.cells)


def powered(
    driven: Sequence[PredictedCell], others: Sequence[OnlyPredicted], confidence: float = CONFIDENCE
) -> Powered | None:
    """Return the prediction-powered success rate over all cells.

    Args:
        driven: cells with real trials, chosen independently of the simulated outcomes.
        others: cells with simulated trials only.
        confidence: of the intervals.

    Returns:
        None with fewer than three real cells or starting positions, or if no cell has simulated trials only.
    """
    if len(driven) < 3 or not others or len({pair.real.cluster for pair in driven}) < 3:
        return None
    outcomes = Outcomes(tuple(pair.real for pair in driven))
    _, real, _ = arrays(outcomes.cells)
    predicted = np.array([pair.predicted for pair in driven])
    elsewhere = np.array([cell.predicted for cell in others])
    starts = [*(pair.real.cluster for pair in driven), *(cell.cluster for cell in others)]
    _, clusters = np.unique(starts, return_inverse=True)
    plain = effective_sample(outcomes, by_cell=True)
    tuning = best_tuning(real, predicted, elsewhere)
    left = _variance_left(real, predicted, elsewhere, clusters, tuning)
    everything = len(driven) + len(others)
    # The gain cannot exceed that of real trials in every cell.
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
        real: (n,) outcomes of the cells with real trials.
        predicted: (n,) simulated outcomes of the same cells.
        elsewhere: (N,) simulated outcomes of the other cells.
        tuning: weight of the simulated outcomes, 0 to 1.
    """
    return float(tuning * elsewhere.mean() + (real - tuning * predicted).mean())


def best_tuning(real: Floats, predicted: Floats, elsewhere: Floats) -> float:
    """Return the tuning that minimizes the variance (PPI++, Section 6), in [0, 1]; 0 without variation."""
    everywhere = np.concatenate([predicted, elsewhere])
    spread = float(np.var(everywhere, ddof=1))
    if spread <= 0:
        return 0.0
    together = float(np.cov(real, predicted, bias=True)[0, 1])
    return min(1.0, max(0.0, together / ((1 + len(real) / len(elsewhere)) * spread)))


def _variance_left(
    real: Floats, predicted: Floats, elsewhere: Floats, clusters: npt.NDArray[np.int64], tuning: float
) -> float:
    """Return the share of the plain estimate's variance that remains, the larger of the cell and cluster values.

    The degrees of freedom used by the tuning are corrected as in an adjusted R squared: a useless simulator leaves 1 on
    average.
    """
    mine = clusters[: len(real)]
    plain = _variance(_parts(real), mine)
    if plain <= 0 or tuning <= 0:
        return 1.0
    # Cells with and without real trials can share a starting position: sum their parts before squaring.
    parts = np.concatenate([_parts(real - tuning * predicted), _parts(tuning * elsewhere)])
    whole_clusters = plain > _variance(_parts(real), np.arange(len(real)))
    facts = len(set(mine.tolist())) if whole_clusters else len(real)
    return _variance(parts, clusters) / plain * (facts - 1) / (facts - 2)


def _parts(values: Floats) -> Floats:
    """Return the contribution of each value to the deviation of their mean."""
    return np.asarray((values - values.mean()) / len(values), np.float64)


def _variance(parts: Floats, clusters: npt.NDArray[np.int64]) -> float:
    """Return the variance of a sum of contributions, the larger of the cell and cluster values."""
    sums = np.bincount(clusters, weights=parts)
    return max(float(parts @ parts), float(sums @ sums))
