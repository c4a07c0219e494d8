"""Agreement of two conditions, cell by cell, and of two judges: error, Cohen's kappa and rank correlation.

Sources: Spearman (1904); Efron and Tibshirani (1993), Chapter 11, for the jackknife; Cohen's kappa (1960). Kadian et
al., "Sim2Real Predictivity" (2020), use the correlation of success rates to assess a simulator.
"""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from vsnbench.statistics.bootstrap import MIN_CLUSTERS, Floats, cluster_draws, percentile_interval
from vsnbench.statistics.clustered import arrays
from vsnbench.statistics.paired import PairedOutcomes
from vsnbench.statistics.rates import CONFIDENCE, UNKNOWN, Interval
from vsnbench.statistics.student import student_quantile


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
    first: Sequence[float], second: Sequence[float], clusters: Sequence[int], confidence: float = CONFIDENCE
) -> RankCorrelation:
    """Return Spearman's rank correlation, with the interval of a jackknife over whole clusters.

    Items of one cluster, such as the cells of a starting position, are correlated. Each cluster is left out once, and
    the spread of Fisher's transformed correlations gives the standard error, with Student's t.

    Args:
        first: value of each item.
        second: another value of each item.
        clusters: cluster of each item.
        confidence: level of the interval. It is unknown for fewer than `MIN_CLUSTERS` clusters, and if all items, or
            all without a cluster, agree perfectly or are constant.
    """
    mine, theirs, of = np.asarray(first, np.float64), np.asarray(second, np.float64), np.asarray(clusters)
    rho = _spearman(mine, theirs) if len(mine) >= _FEWEST_RANKED else math.nan
    names = np.unique(of)
    if len(names) < MIN_CLUSTERS or not abs(rho) < _PERFECT:
        return RankCorrelation(rho, UNKNOWN)
    without = np.array([_spearman(mine[of != name], theirs[of != name]) for name in names])
    if not np.all(np.abs(without) < _PERFECT):
        return RankCorrelation(rho, UNKNOWN)
    leaving = np.arctanh(without)
    spread = math.sqrt((len(names) - 1) / len(names) * float(np.sum((leaving - leaving.mean()) ** 2)))
    reach = student_quantile(len(names) - 1, 0.5 + confidence / 2) * spread
    return RankCorrelation(rho, Interval(math.tanh(math.atanh(rho) - reach), math.tanh(math.atanh(rho) + reach)))


_FEWEST_RANKED = 3
_PERFECT = 1 - 1e-12


def _spearman(first: Floats, second: Floats) -> float:
    """Return the correlation of the ranks, ties at their mean rank; NaN if a list is constant."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return math.nan
    from scipy.stats import rankdata

    return float(np.corrcoef(rankdata(first), rankdata(second))[0, 1])


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
