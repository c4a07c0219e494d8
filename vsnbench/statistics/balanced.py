"""Paired comparisons of many samples of one balanced design at once, for power and for simulations.

A balanced design has the same number of cells at each starting position and of trials in each cell. The formulas are
those of `vsnbench.statistics.clustered`, `paired` and `permutation`, written for arrays of samples; a test checks that
both give the same numbers.
"""

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.student import student_quantile

Floats = npt.NDArray[np.float64]
_SAME = 1e-9
_ASSUMED = 0.5
_CHUNK = 2_000_000


@dataclass(frozen=True, slots=True)
class Intervals:
    """An estimate and its interval for each sample: arrays (samples,)."""

    estimate: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, slots=True)
class _Rates:
    rate: Floats
    worth: Floats
    """Effective number of independent trials."""
    estimated: npt.NDArray[np.bool_]
    """The variance is estimated, so Student's t replaces the normal distribution."""
    around: Intervals

    @property
    def variance(self) -> Floats:
        return np.asarray(self.rate * (1 - self.rate) / self.worth, np.float64)


def rate_intervals(means: Floats, trials: int, confidence: float) -> Intervals:
    """Return the interval of the success rate of each sample, as `clustered.rate_interval` does.

    Args:
        means: (samples, starts, cells) success rate of each cell; at least two starting positions.
        trials: number of trials in each cell.
        confidence: confidence level.
    """
    return _rates(means, trials, confidence).around


def paired_intervals(first: Floats, second: Floats, trials: int, confidence: float) -> Intervals:
    """Return the interval of the paired difference of each sample, as `paired.paired_interval` does.

    Args:
        first: (samples, starts, cells) success rate of the first model in each cell.
        second: success rate of the second model in each cell.
        trials: number of trials of each model in each cell.
        confidence: confidence level.
    """
    a, b = _rates(first, trials, confidence), _rates(second, trials, confidence)
    correlation = _correlation(first - second, a, b)
    down, up = a.rate - a.around.low, b.around.high - b.rate
    below = np.sqrt(np.maximum(0, down**2 + up**2 - 2 * correlation * down * up))
    down, up = b.rate - b.around.low, a.around.high - a.rate
    above = np.sqrt(np.maximum(0, down**2 + up**2 - 2 * correlation * down * up))
    difference = a.rate - b.rate
    return Intervals(difference, np.maximum(-1, difference - below), np.minimum(1, difference + above))


def flip_p_values(sums: Floats) -> Floats:
    """Return the exact sign-flip p-value over starting positions, as `permutation.sign_flip` does.

    Args:
        sums: (samples, starts) difference summed over the cells of each starting position; at most 20 positions.
    """
    starts = sums.shape[1]
    patterns = np.arange(2 ** (starts - 1))[:, None] >> np.arange(starts - 1)
    signs = np.concatenate([np.ones((len(patterns), 1)), 1.0 - 2.0 * (patterns & 1)], axis=1)
    observed = np.abs(sums.sum(1))
    step = max(1, _CHUNK // len(signs))
    parts = [
        (np.abs(signs @ sums[at : at + step].T) >= observed[at : at + step] - _SAME).mean(0)
        for at in range(0, len(sums), step)
    ]
    return np.concatenate(parts)


def _rates(means: Floats, trials: int, confidence: float) -> _Rates:
    _, starts, cells = means.shape
    count = starts * cells
    rate = means.mean((1, 2))
    rate = np.where(rate < 1 - _SAME, np.minimum(1, rate), 1.0)
    spread = rate * (1 - rate)
    rarer = starts * np.minimum(rate, 1 - rate)
    alike = 1 / (1 / _ASSUMED + rarer)
    least = 1 - alike + alike * cells
    alone = spread / count * (1 + (trials - 1) / (1 + rarer) ** 2) / trials
    apart = means - rate[:, None, None]
    by_start = means.mean(2)
    agree = ((by_start < _SAME) | (by_start > 1 - _SAME)).all(1)
    between_starts = (apart.mean(2) ** 2).sum(1) / starts**2
    between_starts = np.where(agree, between_starts, between_starts * starts / (starts - 1))
    variance = np.maximum(least * np.maximum(alone, (apart**2).sum((1, 2)) / count**2), between_starts)
    constant = spread < _SAME
    worth = np.where(constant, count / least, spread / np.where(constant, 1.0, variance))
    quantile = np.where(
        agree | constant, NormalDist().inv_cdf(0.5 + confidence / 2), student_quantile(starts - 1, 0.5 + confidence / 2)
    )
    return _Rates(rate, worth, ~(agree | constant), _wilson(rate, worth, quantile))


def _wilson(rate: Floats, worth: Floats, quantile: Floats) -> Intervals:
    square = quantile**2 / worth
    centre = (rate + square / 2) / (1 + square)
    reach = np.sqrt(rate * (1 - rate) * square + square**2 / 4) / (1 + square)
    low = np.where(rate <= 0, 0.0, np.minimum(np.maximum(0, centre - reach), rate))
    high = np.where(rate >= 1, 1.0, np.maximum(np.minimum(1, centre + reach), rate))
    return Intervals(rate, low, high)


def _correlation(differences: Floats, a: _Rates, b: _Rates) -> Floats:
    _, starts, cells = differences.shape
    apart = differences - differences.mean((1, 2))[:, None, None]
    between_starts = (apart.mean(2) ** 2).sum(1) / starts**2
    between_starts *= np.where(a.estimated | b.estimated, starts / (starts - 1), 1.0)
    variance = np.maximum((apart**2).sum((1, 2)) / (starts * cells) ** 2, between_starts)
    product = a.variance * b.variance
    some = product > 0
    root = np.sqrt(np.where(some, product, 1.0))
    correlation = np.where(some, (a.variance + b.variance - variance) / (2 * root), 0.0)
    spread = np.sqrt(np.where(some, a.rate * (1 - a.rate) * b.rate * (1 - b.rate), 1.0))
    shrunk = np.maximum(0, correlation - 1 / (2 * np.minimum(a.worth, b.worth) * spread))
    return np.asarray(np.clip(np.where(correlation > 0, shrunk, correlation), -1, 1), np.float64)
