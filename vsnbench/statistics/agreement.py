"""Agreement of two conditions, cell by cell, and of two judges: error, Cohen's kappa and rank correlation.

Sources: Spearman (1904) with the interval of Bonett and Wright (2000); Cohen's kappa (1960). Kadian et al., "Sim2Real
Predictivity" (2020), use the correlation of success rates to assess a simulator.
"""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from vsnbench.statistics.bootstrap import MIN_CLUSTERS, Floats, cluster_draws, percentile_interval
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


@dataclass(frozen=True, slots=True)
class JudgedTwice:
    """Two judges' categories for one item."""

    cluster: Hashable
    """Items of one cluster, such as a starting position, are correlated."""
    first: Hashable
    second: Hashable


@dataclass(frozen=True, slots=True)
class JudgeAgreement:
    """Agreement of two judges over the same items."""

    items: int
    same: float
    """Share of items in the same category; NaN without items."""
    kappa: float
    """`same` corrected for chance; NaN if both judges used one and the same category."""
    interval: Interval
    """Of kappa, from resampled clusters; unknown with few clusters or if every resample agrees completely."""


def judge_agreement(items: Sequence[JudgedTwice]) -> JudgeAgreement:
    """Return raw agreement and Cohen's kappa of two judges, with a bootstrap interval over whole clusters."""
    if not items:
        return JudgeAgreement(0, math.nan, math.nan, UNKNOWN)
    clusters = {name: place for place, name in enumerate(dict.fromkeys(item.cluster for item in items))}
    categories = dict.fromkeys(category for item in items for category in (item.first, item.second))
    places = {category: place for place, category in enumerate(categories)}
    counts = np.zeros((len(clusters), len(places), len(places)))
    for item in items:
        counts[clusters[item.cluster], places[item.first], places[item.second]] += 1
    same, kappa = (float(value) for value in _same_and_kappa(counts.sum(axis=0)))
    interval = UNKNOWN
    if len(clusters) >= MIN_CLUSTERS:
        resampled = np.tensordot(cluster_draws(len(clusters)), counts, axes=1)
        interval = percentile_interval(_same_and_kappa(resampled)[1], len(clusters))
    return JudgeAgreement(len(items), same, kappa, interval)


def _same_and_kappa(tables: Floats) -> tuple[Floats, Floats]:
    """Return raw agreement and kappa of contingency tables (..., categories, categories)."""
    shares = tables / tables.sum(axis=(-2, -1), keepdims=True)
    same = np.trace(shares, axis1=-2, axis2=-1)
    chance = (shares.sum(axis=-1) * shares.sum(axis=-2)).sum(axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return same, np.where(chance < 1 - 1e-12, (same - chance) / (1 - chance), np.nan)
