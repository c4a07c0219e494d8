"""The real success rate from few real trials and all simulated ones of the same cells: prediction-powered, tuned.

Angelopoulos, Duchi and Zrnic, "PPI++: Efficient Prediction-Powered Inference" (2023): the simulator's outcome of a cell
predicts the real one; its mean over the cells without real trials is corrected by how wrong it was where there are
some, and `tuning`, 0 to 1, is how much it is trusted, chosen to make the variance least. Whatever the simulator is
worth, the estimate is right on average. Never the headline: it stands beside the plain estimate, with what it saved.

The point and the tuning are those of the paper. The interval is not its normal one, which is short for few trials and
rates near 0 or 1: the variance is that of whole starting positions, never less than if every cell had been driven for
real, and goes into Wilson's interval with Student's t. Coverage by simulation is in `docs/statistics.md`.
"""

import math
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
    mine = clusters[: len(driven)]
    tuning = best_tuning(real, predicted, elsewhere)
    rate = min(1.0, max(0.0, point(real, predicted, elsewhere, tuning)))
    plain = effective_sample(outcomes, by_cell=True)
    plain_interval = plain.interval(confidence)
    if tuning <= 0:
        return Powered(plain.rate, plain_interval, plain.rate, plain_interval, 0.0, len(driven), len(driven))
    # Cells with and without real trials may lie at one position: what they add is summed up before it is squared.
    parts = np.concatenate([_parts(real - tuning * predicted), _parts(tuning * elsewhere)])
    variance = _variance(parts, clusters)
    spread = rate * (1 - rate)
    everything = len(driven) + len(others)
    # As if each cell had been driven once is the most that any simulator can be worth.
    trials = min(float(everything), spread / variance) if variance > 0 and spread > 0 else float(everything)
    trials = max(1.0, trials)
    if spread <= 0:
        trials = plain.trials  # at 0 or 1 the simulator's own spread says nothing
    alone = _variance(_parts(real), mine)
    return Powered(
        rate=rate,
        interval=wilson_at(rate, trials, confidence, float(len(set(mine.tolist())) - 1)),
        plain_rate=plain.rate,
        plain_interval=plain_interval,
        tuning=tuning,
        cells=len(driven),
        worth=min(float(everything), len(driven) * alone / variance) if variance > 0 else float(everything),
    )


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


def _parts(values: Floats) -> Floats:
    """Return what each value adds to the deviation of their mean."""
    apart = (values - values.mean()) / len(values)
    return np.asarray(apart * math.sqrt(len(values) / (len(values) - 1)) if len(values) > 1 else apart, np.float64)


def _variance(parts: Floats, clusters: npt.NDArray[np.int64]) -> float:
    """Return the variance of a sum of such parts, the larger of what cells and clusters tell."""
    sums = np.bincount(clusters, weights=parts)
    return max(float(parts @ parts), float(sums @ sums))
