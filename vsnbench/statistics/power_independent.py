"""Power of two independent samples: exact for Fisher's test, by simulation for clustered samples.

If several episodes share a starting position, the test that exchanges whole positions is applied to outcomes simulated
as in `vsnbench.statistics.power`.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.clustered import Outcomes, arrays
from vsnbench.statistics.power import (
    MAX_STARTS,
    SAMPLES,
    Resemblance,
    common_parts,
    drawn_rates,
    least,
    own_resemblance,
)
from vsnbench.statistics.rates import POWER

Floats = npt.NDArray[np.float64]
_DEALS = 1999
_BY_STUDENT_FROM = 40
_TIE = 1e-9


@dataclass(frozen=True, slots=True)
class ExchangeDesign:
    """Design of two independent samples of starting positions, one per model."""

    starts: tuple[int, int]
    cells: int
    """Goals per starting position."""
    trials: int
    """Episodes per cell."""
    rate: float
    """Mean of the two success rates."""
    resemblance: Resemblance
    level: float = 0.05


def exchange_design_of(first: Outcomes, second: Outcomes, level: float) -> ExchangeDesign:
    """Return the design of two recorded independent samples; each has at least one cell."""
    cells = len(first.cells) + len(second.cells)
    means = [float(arrays(outcomes.cells)[1].mean()) for outcomes in (first, second)]
    return ExchangeDesign(
        starts=(first.clusters, second.clusters),
        cells=max(1, round(cells / (first.clusters + second.clusters))),
        trials=max(1, round(float(np.median([cell.trials for cell in (*first.cells, *second.cells)])))),
        rate=min(0.99, max(0.01, sum(means) / 2)),
        resemblance=own_resemblance(first, second),
        level=level,
    )


def least_exchange_p(first: int, second: int) -> float:
    """Return the smallest two-sided p-value of permuting this many clusters between two samples.

    One permutation separates them completely, or two if the samples have the same size.
    """
    return min(1.0, (1 + (first == second)) / math.comb(first + second, first))


def min_exchanged_starts(level: float) -> int:
    """Return the clusters that each sample needs for a p-value below this level to be possible."""
    return next(episodes for episodes in range(1, 600) if least_exchange_p(episodes, episodes) < level)


def exchange_power(design: ExchangeDesign, difference: float, seed: int = 0) -> float:
    """Return the power of exchanging whole positions for a true difference, from 600 simulated experiments."""
    random = np.random.default_rng(seed)
    first = min(0.999, max(0.001, design.rate + difference / 2))
    second = min(0.999, max(0.001, first - difference))
    of_start, of_cell = design.resemblance.of_normals
    sums = [
        drawn_rates(
            random,
            rate,
            common_parts(random, (SAMPLES, starts, design.cells), of_start, of_cell),
            of_cell,
            design.trials,
        )
        for rate, starts in zip((min(0.999, second + difference), second), design.starts, strict=True)
    ]
    return float(np.mean(_exchange_p_values(random, *sums) <= design.level))


def exchange_detectable(design: ExchangeDesign) -> float | None:
    """Return the smallest difference found with 80 % power, in steps of 0.01; None if there is none."""
    points = least(lambda step: exchange_power(design, step / 100) >= POWER, 1, 99)
    return None if points is None else points / 100


def exchange_starts_needed(design: ExchangeDesign, difference: float) -> int | None:
    """Return the starting positions that each model needs for 80 % power; None above 1,000."""
    return least(
        lambda starts: exchange_power(replace(design, starts=(starts, starts)), difference) >= POWER, 2, MAX_STARTS
    )


def _exchange_p_values(random: np.random.Generator, first: Floats, second: Floats) -> Floats:
    """Return the p-value of each sample, (samples,); Student's t above 40 positions."""
    mine, everyone = first.shape[1], np.concatenate([first, second], axis=1).T
    size = len(everyone)
    total = everyone.sum(0)

    def apart(dealt: Floats) -> Floats:
        return np.asarray(np.abs(dealt / mine - (total - dealt) / (size - mine)), np.float64)

    observed = apart(everyone[:mine].sum(0))
    if size > _BY_STUDENT_FROM:
        from scipy.special import stdtr

        within = first.var(1) * mine + second.var(1) * (size - mine)
        spread = np.sqrt(within / (size - 2) * (1 / mine + 1 / (size - mine)))
        with np.errstate(invalid="ignore", divide="ignore"):
            student = np.where(spread > 0, observed / spread, np.where(observed > _TIE, np.inf, 0.0))
        return np.asarray(2 * stdtr(size - 2, -student), np.float64)
    if math.comb(size, mine) <= _DEALS + 1:
        chosen = [list(members) for members in itertools.combinations(range(size), mine)]
        dealt, extra = np.zeros((len(chosen), size)), 0
        for row, members in zip(dealt, chosen, strict=True):
            row[members] = 1
    else:
        order = np.argsort(random.random((_DEALS, size)), axis=1)
        dealt, extra = (order < mine).astype(np.float64), 1
    beyond = apart(dealt @ everyone) >= observed - _TIE
    return np.asarray((extra + beyond.sum(0)) / (extra + len(dealt)), np.float64)


def independent_detectable(first_trials: int, second_trials: int, rate: float, level: float) -> float | None:
    """Return the smallest difference around a mean rate that Fisher's test finds with 80 % power, in steps of 0.01."""
    rejects = _fisher_rejects(first_trials, second_trials, level)

    def enough(points: int) -> bool:
        first = min(1.0, max(points / 100, rate + points / 200))
        return _fisher_power(rejects, first, first - points / 100) >= POWER

    points = least(enough, 1, 100)
    return None if points is None else points / 100


def independent_trials_needed(first: float, second: float, level: float) -> int | None:
    """Return the trials per sample that Fisher's test needs to separate two rates with 80 % power.

    Normal approximation with continuity correction (Casagrande, Pike and Smith 1978), close to the exact power. None
    for equal rates.
    """
    if not (math.isfinite(first) and math.isfinite(second)) or first == second:
        return None
    from scipy.stats import norm

    mean, apart = (first + second) / 2, abs(first - second)
    spread = float(norm.isf(level / 2)) * math.sqrt(2 * mean * (1 - mean)) + float(norm.ppf(POWER)) * math.sqrt(
        first * (1 - first) + second * (1 - second)
    )
    plain = (spread / apart) ** 2
    return math.ceil(plain / 4 * (1 + math.sqrt(1 + 4 / (plain * apart))) ** 2)


def _fisher_rejects(first: int, second: int, level: float) -> npt.NDArray[np.bool_]:
    """Return (first + 1, second + 1): whether Fisher's test rejects for these numbers of successes."""
    from scipy.stats import hypergeom

    rejects = np.zeros((first + 1, second + 1), bool)
    for successes in range(first + second + 1):
        mine = np.arange(max(0, successes - second), min(first, successes) + 1)
        chances = hypergeom(first + second, successes, first).pmf(mine)
        order = np.argsort(chances)
        summed = np.cumsum(chances[order])
        # Tables as likely as the observed one count as extreme: use the sum at the last tie.
        last = np.searchsorted(chances[order], chances * (1 + 1e-7), side="right") - 1
        rejects[mine, successes - mine] = summed[last] <= level
    return rejects


def _fisher_power(rejects: npt.NDArray[np.bool_], first: float, second: float) -> float:
    from scipy.stats import binom

    trials = rejects.shape[0] - 1, rejects.shape[1] - 1
    mine, theirs = (binom.pmf(np.arange(n + 1), n, rate) for n, rate in zip(trials, (first, second), strict=True))
    return float(mine @ rejects @ theirs)
