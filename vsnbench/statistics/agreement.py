"""How far two conditions agree cell by cell, as a simulated twin with the real place: error, agreement, ranks.

Sources: Spearman (1904), with the interval of Bonett and Wright (2000); Cohen's kappa (1960). Sim-to-real correlation
of rates is what Kadian et al., "Sim2Real Predictivity" (2020), ask of a simulator.
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
    """How two conditions agree over the cells they share; NaN where it cannot be said."""

    cells: int
    bias: float
    """Mean over the cells of the second's rate less the first's: how far the twin flatters, -1 to 1."""
    error: float
    """Root of the mean squared difference of rates, 0 to 1; with few episodes a cell chance is a part of it."""
    same: float
    """Chance that an episode of each in one cell have the same outcome, 0 to 1."""
    kappa: float
    """The same beyond what the two rates alone would give; 1 is perfect, 0 is chance."""


def agreement(outcomes: PairedOutcomes) -> Agreement:
    """Return how two conditions agree; each cell weighs the same."""
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
    """Spearman's rank correlation of two lists of the same things."""

    rho: float
    """-1 to 1; NaN for fewer than three, or where one list does not vary."""
    interval: Interval
    things: int


def rank_correlation(
    first: Sequence[float], second: Sequence[float], confidence: float = CONFIDENCE
) -> RankCorrelation:
    """Return Spearman's rank correlation; its interval is unknown for fewer than four things."""
    things = len(first)
    if things < 3 or len(set(first)) < 2 or len(set(second)) < 2:
        return RankCorrelation(math.nan, UNKNOWN, things)
    from scipy.stats import norm, spearmanr

    rho = float(spearmanr(first, second).statistic)
    if things < 4 or abs(rho) >= 1 - 1e-12:
        return RankCorrelation(rho, UNKNOWN, things)
    reach = float(norm.ppf(0.5 + confidence / 2)) * math.sqrt((1 + rho * rho / 2) / (things - 3))
    return RankCorrelation(
        rho, Interval(math.tanh(math.atanh(rho) - reach), math.tanh(math.atanh(rho) + reach)), things
    )
