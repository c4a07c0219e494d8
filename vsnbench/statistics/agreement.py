"""Agreement of two conditions, cell by cell: error, agreement and rank correlation.

Sources: Spearman (1904) with the interval of Bonett and Wright (2000); Cohen's kappa (1960). Kadian et al., "Sim2Real
Predictivity" (2020), use the correlation of success rates to assess a simulator.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsnbench.statistics.clustered import arrays
from vsnbench.statistics.paired import PairedOutcomes
from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement of two conditions over their shared cells; NaN where it is undefined."""

    cells: int
    bias: float
    """Mean over the cells of the second rate minus the first, -1 to 1."""
    error: float
    """Root mean square difference of the rates, 0 to 1. With few episodes per cell, chance contributes to it."""
    same: float
    """Probability that one episode of each condition in the same cell have the same outcome, 0 to 1."""
    kappa: float
    """`same` corrected for the agreement expected from the two rates: 1 is perfect, 0 is chance."""


def agreement(outcomes: PairedOutcomes) -> Agreement:
    """Return the agreement of two conditions; every cell has the same weight."""
    if not outcomes.cells:
        return Agreement(0, math.nan, math.nan, math.nan, math.nan)
    mine, theirs = arrays(outcomes.first.cells)[1], arrays(outcomes.second.cells)[1]
    same = float(np.mean(mine * theirs + (1 - mine) * (1 - theirs)))
    p, q = float(mine.mean()), float(theirs.mean())
    chance = p * q + (1 - p) * (1 - q)
    return Agreement(
        cells=len(mine),
        bias=q - p,
        error=math.sqrt(float(np.mean((theirs - mine) ** 2))),
        same=same,
        kappa=(same - chance) / (1 - chance) if chance < 1 else math.nan,
    )


@dataclass(frozen=True, slots=True)
class RankCorrelation:
    """Spearman's rank correlation of two lists over the same items."""

    rho: float
    """-1 to 1; NaN for fewer than three items or if a list is constant."""
    interval: Interval


def rank_correlation(
    first: Sequence[float], second: Sequence[float], confidence: float = CONFIDENCE
) -> RankCorrelation:
    """Return Spearman's rank correlation; the interval is unknown for fewer than four items."""
    things = len(first)
    if things < 3 or len(set(first)) < 2 or len(set(second)) < 2:
        return RankCorrelation(math.nan, UNKNOWN)
    from scipy.stats import norm, spearmanr

    rho = float(spearmanr(first, second).statistic)
    if things < 4 or abs(rho) >= 1 - 1e-12:
        return RankCorrelation(rho, UNKNOWN)
    reach = float(norm.ppf(0.5 + confidence / 2)) * math.sqrt((1 + rho * rho / 2) / (things - 3))
    return RankCorrelation(rho, Interval(math.tanh(math.atanh(rho) - reach), math.tanh(math.atanh(rho) + reach)))
