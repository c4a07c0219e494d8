"""Tests that exchange whole clusters: they hold their level however much the episodes of a cluster resemble each other.

Sources: Fisher (1935); Gail et al., "On design considerations and randomization-based inference for community
intervention trials" (1996), for whole clusters; Cochran (1950) for more than two matched samples. An exact p-value is
counted, not drawn, where that is cheap; else the draws are seeded, and the observed arrangement is one of them (Phipson
and Smyth 2010), so that no p-value is too small. At most 5 % are below 0.05 where nothing differs.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
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
    """Return the two-sided p-value of flipping the sign of each difference: is their sum further from 0 than chance?

    Exact for up to 20 differences that are not 0, and for any number of them that are multiples of a common fraction.
    """
    apart = np.array([each for each in differences if abs(each) > _TIE])
    if not len(apart):
        return 1.0
    observed = abs(float(apart.sum()))
    if len(apart) <= _EXACT_UP_TO:
        sums = np.array([apart[0]])  # the first sign stands: the other half mirrors this one
        for each in apart[1:]:
            sums = np.concatenate((sums + each, sums - each))
        return float(np.mean(np.abs(sums) >= observed - _TIE))
    if steps := _whole_steps(apart):
        return _counted(steps)
    random = np.random.default_rng(0)
    signs = random.integers(0, 2, (DRAWS, len(apart)), dtype=np.int8) * 2.0 - 1.0
    return float((1 + np.sum(np.abs(signs @ apart) >= observed - _TIE)) / (DRAWS + 1))


def _whole_steps(apart: Floats) -> list[int] | None:
    """Return the differences in units of their common fraction; None where it is too fine."""
    fractions = [Fraction(float(each)).limit_denominator(1000) for each in apart]
    unit = math.lcm(*(each.denominator for each in fractions))
    if unit > _FINEST or any(abs(float(f) - d) > _TIE for f, d in zip(fractions, apart, strict=True)):
        return None
    steps = [int(each * unit) for each in fractions]
    return steps if sum(abs(each) for each in steps) <= _FINEST else None


def _counted(steps: Sequence[int]) -> float:
    reach = sum(abs(each) for each in steps)
    chances: Floats = np.zeros(2 * reach + 1)
    chances[reach] = 1.0
    for each in steps:
        chances = (np.roll(chances, each) + np.roll(chances, -each)) / 2
    return float(min(1.0, chances[np.abs(np.arange(-reach, reach + 1)) >= abs(sum(steps))].sum()))


def exchange_clusters(first: Outcomes, second: Outcomes, seed: int = 0, draws: int = DRAWS) -> float:
    """Return the two-sided p-value of dealing the clusters of two separate samples anew between them.

    The statistic is the difference of the success rates. Fisher's exact test where every episode has a cluster to
    itself; else so many seeded deals. 1 where either has no trials.
    """
    if not first.cells or not second.cells:
        return 1.0
    if first.independent and second.independent:
        return fisher(first.proportion, second.proportion)
    sides = [_cluster_counts(each) for each in (first, second)]
    successes, trials = (np.concatenate([side[which] for side in sides]) for which in (0, 1))
    size = len(sides[0][0])
    order = np.argsort(np.random.default_rng(seed).random((draws, len(trials))), axis=1)[:, :size]
    mine, tried = successes[order].sum(1), trials[order].sum(1)
    apart = np.abs(mine / tried - (successes.sum() - mine) / (trials.sum() - tried))
    observed = abs(first.proportion.rate - second.proportion.rate)
    return float((1 + np.sum(apart >= observed - _TIE)) / (draws + 1))


def fisher_effective(first: Outcomes, second: Outcomes) -> float:
    """Return the p-value of Fisher's exact test on what two samples are worth in independent trials, rounded down.

    For a sample of which only the counts are known, laid beside a clustered one: nothing can be exchanged there. After
    Rao and Scott (1992). Fisher's own p-value where nothing repeats.
    """
    if not first.cells or not second.cells:
        return 1.0
    worth = []
    for each in (first, second):
        sample = effective_sample(each)
        trials = max(1, math.floor(sample.trials + _TIE))
        worth.append(Proportion(round(sample.rate * trials), trials))
    return fisher(*worth)


def _cluster_counts(outcomes: Outcomes) -> tuple[Floats, Floats]:
    clusters, means, trials = arrays(outcomes.cells)
    successes, tried = np.bincount(clusters, weights=means * trials), np.bincount(clusters, weights=trials)
    return np.asarray(successes, np.float64), np.asarray(tried, np.float64)


def exchange_models(rates: npt.ArrayLike, seed: int = 0) -> float:
    """Return the p-value of dealing the models anew within each cluster: does any model differ from the others?

    Cochran's Q as a randomization test: the statistic is the spread of the models' totals, and each cluster's row of
    outcomes is shuffled as a whole. Exact where there are at most 20,000 arrangements, else 19,999 seeded ones.

    Args:
        rates: (clusters, models) sum of the rates of a cluster's cells, of each model.
        seed: makes the answer repeatable.
    """
    from itertools import permutations, product

    rows = np.asarray(rates, np.float64)
    rows = rows[np.ptp(rows, axis=1) > _TIE]  # where all models do alike nothing can be dealt
    if not len(rows):
        return 1.0
    observed = float(np.var(rows.sum(0)))
    models = rows.shape[1]
    if len(rows) * math.log(math.factorial(models)) <= math.log(DRAWS + 1):
        ways = [list(permutations(row)) for row in rows.tolist()]
        totals = np.array([np.sum(deal, axis=0) for deal in product(*ways)])
        return float(np.mean(totals.var(axis=1) >= observed - _TIE))
    random = np.random.default_rng(seed)
    totals = np.zeros((DRAWS, models))
    for row in rows:
        totals += row[np.argsort(random.random((DRAWS, models)), axis=1)]
    return float((1 + np.sum(totals.var(axis=1) >= observed - _TIE)) / (DRAWS + 1))


@dataclass(frozen=True, slots=True)
class Stratum:
    """The outcomes of two models in one stratum (one starting position)."""

    first: Proportion
    second: Proportion


def stratified_permutation(strata: Sequence[Stratum]) -> float:
    """Return the exact two-sided p-value of permuting which model an episode belongs to, within each stratum.

    The statistic is the first model's number of successes. Within a stratum it is hypergeometric, and the sum over
    the strata is their convolution: no random permutations are drawn. How hard a starting position is cancels out;
    that a model may be good at one position and not at another does not: with several episodes a position it finds
    too many differences, and is given beside, not read.
    """
    most = max((each.first.trials + each.second.trials for each in strata), default=0)
    log_factorials = np.concatenate(([0.0], np.cumsum(np.log(np.arange(1, most + 1)))))
    distribution: Floats = np.ones(1)
    observed, expected = 0, 0.0
    for stratum in strata:
        total = stratum.first.trials + stratum.second.trials
        successes = stratum.first.successes + stratum.second.successes
        if not stratum.first.trials or not stratum.second.trials:
            continue  # nobody to exchange with
        here = _hypergeometric(total, successes, stratum.first.trials, log_factorials)
        distribution = np.clip(_sum_of_two(distribution, here), 0.0, 1.0)
        observed += stratum.first.successes
        expected += stratum.first.trials * successes / total
    distance = np.abs(np.arange(len(distribution)) - expected)
    return float(min(1.0, distribution[distance >= abs(observed - expected) - _TIE].sum()))


def _hypergeometric(total: int, successes: int, drawn: int, log_factorials: Floats) -> Floats:
    """Return the probability of 0 to `drawn` successes among those drawn; scipy's takes forty times as long."""
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
    """Return the distribution of the sum of two independent counts; importing scipy.signal would take longer."""
    if min(len(first), len(second)) <= _FFT_FROM:
        return np.convolve(first, second)
    length = len(first) + len(second) - 1
    size = 1 << (length - 1).bit_length()
    return np.fft.irfft(np.fft.rfft(first, size) * np.fft.rfft(second, size), size)[:length]


_FFT_FROM = 500
