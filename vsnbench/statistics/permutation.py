"""Permutation tests that exchange whole clusters and hold their level for correlated episodes.

Sources: Fisher (1935); Gail et al., "On design considerations and randomization-based inference for community
intervention trials" (1996), for whole clusters; Cochran (1950) for more than two matched samples. p-values are exact
where that is cheap; otherwise the permutations are drawn with a fixed seed and include the observed one (Phipson and
Smyth 2010).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import permutations, product
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.clustered import Outcomes, arrays, effective_sample
from vsnbench.statistics.rates import Proportion, fisher

Floats = npt.NDArray[np.float64]
DRAWS = 19_999
_EXACT_UP_TO = 20
_FINEST = 720_720
_TIE = 1e-9


def sign_flip(differences: Sequence[float]) -> float:
    """Return the two-sided sign-flip p-value of the sum of the differences.

    Exact for up to 20 nonzero differences, and for any number that are multiples of a common fraction.
    """
    apart = np.array([difference for difference in differences if abs(difference) > _TIE])
    if not len(apart):
        return 1.0
    observed = abs(float(apart.sum()))
    if len(apart) <= _EXACT_UP_TO:
        sums = np.array([apart[0]])  # the first sign is fixed: the other half is the mirror image
        for difference in apart[1:]:
            sums = np.concatenate((sums + difference, sums - difference))
        return float(np.mean(np.abs(sums) >= observed - _TIE))
    if steps := _whole_steps(apart):
        return _counted(steps)
    random = np.random.default_rng(0)
    signs = random.integers(0, 2, (DRAWS, len(apart)), dtype=np.int8) * 2.0 - 1.0
    return float((1 + np.sum(np.abs(signs @ apart) >= observed - _TIE)) / (DRAWS + 1))


def _whole_steps(apart: Floats) -> list[int] | None:
    """Return the differences as multiples of a common fraction; None if the fraction is too small."""
    fractions = [Fraction(float(difference)).limit_denominator(1000) for difference in apart]
    unit = math.lcm(*(fraction.denominator for fraction in fractions))
    if unit > _FINEST or any(abs(float(f) - d) > _TIE for f, d in zip(fractions, apart, strict=True)):
        return None
    steps = [int(fraction * unit) for fraction in fractions]
    return steps if sum(abs(step) for step in steps) <= _FINEST else None


def _counted(steps: Sequence[int]) -> float:
    reach = sum(abs(step) for step in steps)
    chances: Floats = np.zeros(2 * reach + 1)
    chances[reach] = 1.0
    for step in steps:
        chances = (np.roll(chances, step) + np.roll(chances, -step)) / 2
    return float(min(1.0, chances[np.abs(np.arange(-reach, reach + 1)) >= abs(sum(steps))].sum()))


def exchange_clusters(first: Outcomes, second: Outcomes, draws: int = DRAWS) -> float:
    """Return the two-sided p-value of permuting the clusters of two independent samples between them.

    The statistic is the difference of the success rates. Fisher's exact test if every episode is a cluster of its own,
    else seeded permutations. 1 if either sample is empty.
    """
    if not first.cells or not second.cells:
        return 1.0
    if first.independent and second.independent:
        return fisher(first.proportion, second.proportion)
    sides = [_cluster_counts(outcomes) for outcomes in (first, second)]
    successes, trials = (np.concatenate([side[which] for side in sides]) for which in (0, 1))
    size = len(sides[0][0])
    order = np.argsort(np.random.default_rng(0).random((draws, len(trials))), axis=1)[:, :size]
    mine, tried = successes[order].sum(1), trials[order].sum(1)
    apart = np.abs(mine / tried - (successes.sum() - mine) / (trials.sum() - tried))
    observed = abs(first.proportion.rate - second.proportion.rate)
    return float((1 + np.sum(apart >= observed - _TIE)) / (draws + 1))


def fisher_effective(first: Outcomes, second: Outcomes) -> float:
    """Return the p-value of Fisher's exact test on the effective sample sizes, rounded down (Rao and Scott 1992).

    For the comparison of a clustered sample with published counts, whose clusters are unknown. Fisher's exact p-value
    without repetitions.
    """
    if not first.cells or not second.cells:
        return 1.0
    worth = []
    for outcomes in (first, second):
        sample = effective_sample(outcomes)
        trials = max(1, math.floor(sample.trials + _TIE))
        worth.append(Proportion(round(sample.rate * trials), trials))
    return fisher(*worth)


def _cluster_counts(outcomes: Outcomes) -> tuple[Floats, Floats]:
    clusters, means, trials = arrays(outcomes.cells)
    successes, tried = np.bincount(clusters, weights=means * trials), np.bincount(clusters, weights=trials)
    return np.asarray(successes, np.float64), np.asarray(tried, np.float64)


def exchange_models(rates: npt.ArrayLike) -> float:
    """Return the p-value of permuting the models within each cluster: does any model differ from the others?

    Cochran's Q as a randomization test: the statistic is the variance of the models' totals, and each cluster's row is
    permuted as a whole. Exact for up to 20,000 arrangements, else 19,999 seeded ones.

    Args:
        rates: (clusters, models) sum of the rates of a cluster's cells for each model.
    """
    rows = np.asarray(rates, np.float64)
    rows = rows[np.ptp(rows, axis=1) > _TIE]  # rows in which all models are equal do not change the statistic
    if not len(rows):
        return 1.0
    observed = float(np.var(rows.sum(0)))
    models = rows.shape[1]
    if len(rows) * math.log(math.factorial(models)) <= math.log(DRAWS + 1):
        ways = [list(permutations(row)) for row in rows.tolist()]
        totals = np.array([np.sum(deal, axis=0) for deal in product(*ways)])
        return float(np.mean(totals.var(axis=1) >= observed - _TIE))
    random = np.random.default_rng(0)
    totals = np.zeros((DRAWS, models))
    for row in rows:
        totals += row[np.argsort(random.random((DRAWS, models)), axis=1)]
    return float((1 + np.sum(totals.var(axis=1) >= observed - _TIE)) / (DRAWS + 1))


@dataclass(frozen=True, slots=True)
class Stratum:
    """Outcomes of two models in one stratum (starting position)."""

    first: Proportion
    second: Proportion


def stratified_permutation(strata: Sequence[Stratum]) -> float:
    """Return the exact two-sided p-value of permuting the model labels of the episodes within each stratum.

    The statistic is the first model's number of successes. It is hypergeometric within a stratum, and its distribution
    over all strata is the convolution of these. Differences in difficulty between strata cancel out. With several
    correlated episodes of a model per stratum the test rejects too often.
    """
    most = max((stratum.first.trials + stratum.second.trials for stratum in strata), default=0)
    log_factorials = np.concatenate(([0.0], np.cumsum(np.log(np.arange(1, most + 1)))))
    distribution: Floats = np.ones(1)
    observed, expected = 0, 0.0
    for stratum in strata:
        total = stratum.first.trials + stratum.second.trials
        successes = stratum.first.successes + stratum.second.successes
        if not stratum.first.trials or not stratum.second.trials:
            continue  # one model has no episodes in this stratum
        here = _hypergeometric(total, successes, stratum.first.trials, log_factorials)
        distribution = np.clip(_sum_of_two(distribution, here), 0.0, 1.0)
        observed += stratum.first.successes
        expected += stratum.first.trials * successes / total
    distance = np.abs(np.arange(len(distribution)) - expected)
    return float(min(1.0, distribution[distance >= abs(observed - expected) - _TIE].sum()))


def _hypergeometric(total: int, successes: int, drawn: int, log_factorials: Floats) -> Floats:
    """Return the hypergeometric probabilities of 0 to `drawn` successes; 40 times as fast as SciPy's."""
    there = np.arange(drawn + 1)
    possible = (there <= successes) & (drawn - there <= total - successes)
    k = there[possible]

    def choose(n: int, of: Any) -> Any:
        return log_factorials[n] - log_factorials[of] - log_factorials[n - of]

    logs = choose(successes, k) + choose(total - successes, drawn - k) - choose(total, drawn)
    probabilities = np.zeros(drawn + 1)
    probabilities[possible] = np.exp(logs)
    return probabilities


def _sum_of_two(first: Floats, second: Floats) -> Floats:
    """Return the distribution of the sum of two independent counts, without importing scipy.signal."""
    if min(len(first), len(second)) <= _FFT_FROM:
        return np.convolve(first, second)
    length = len(first) + len(second) - 1
    size = 1 << (length - 1).bit_length()
    return np.fft.irfft(np.fft.rfft(first, size) * np.fft.rfft(second, size), size)[:length]


_FFT_FROM = 500
