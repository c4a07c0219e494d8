"""What two independent samples can show: where nothing repeats Fisher's test, counted out exactly; else by simulation.

Where several episodes share a starting position, whole positions are exchanged between the samples, and that test is
run on simulated outcomes as `vsnbench.statistics.power` draws them.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.clustered import Outcomes, arrays
from vsnbench.statistics.power import (
    MOST_STARTS,
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
    """Two separate samples of starting positions, each tried by one model."""

    starts: tuple[int, int]
    cells: int
    """Goals from each starting position."""
    trials: int
    """Episodes in each cell."""
    rate: float
    """Mean of the two success rates."""
    resemblance: Resemblance
    level: float = 0.05


def exchange_design_of(first: Outcomes, second: Outcomes, level: float) -> ExchangeDesign:
    """Return the design that two separate samples came from; each of at least one cell."""
    cells = len(first.cells) + len(second.cells)
    means = [float(arrays(each.cells)[1].mean()) for each in (first, second)]
    return ExchangeDesign(
        starts=(first.clusters, second.clusters),
        cells=max(1, round(cells / (first.clusters + second.clusters))),
        trials=max(1, round(float(np.median([cell.trials for cell in (*first.cells, *second.cells)])))),
        rate=min(0.99, max(0.01, sum(means) / 2)),
        resemblance=own_resemblance(first, second),
        level=level,
    )


def least_exchange_p(first: int, second: int) -> float:
    """Return the least two-sided p-value of dealing so many clusters, or single trials, anew between two samples.

    One deal of all separates them completely, or two where the samples are of one size and its mirror does so too.
    """
    return min(1.0, (1 + (first == second)) / math.comb(first + second, first))


def fewest_exchanged(level: float) -> int:
    """Return how many clusters each of two samples must have for a p-value below this level at all."""
    return next(each for each in range(1, 600) if least_exchange_p(each, each) < level)


def exchange_power(design: ExchangeDesign, difference: float, seed: int = 0) -> float:
    """Return how often exchanging whole positions finds a true difference of rates, by 600 simulated experiments."""
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


def exchange_detectable(design: ExchangeDesign, wanted: float = POWER) -> float | None:
    """Return the smallest difference of rates that the design shows with this power, to a point; None for none."""
    points = least(lambda step: exchange_power(design, step / 100) >= wanted, 1, 99)
    return None if points is None else points / 100


def exchange_starts_needed(design: ExchangeDesign, difference: float, wanted: float = POWER) -> int | None:
    """Return how many starting positions each model needs to show the difference; None beyond 1,000."""
    return least(
        lambda starts: exchange_power(replace(design, starts=(starts, starts)), difference) >= wanted, 2, MOST_STARTS
    )


def _exchange_p_values(random: np.random.Generator, first: Floats, second: Floats) -> Floats:
    """Return the p-value of each sample, (samples,); Student's t where there are many positions."""
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
        chosen = [list(each) for each in itertools.combinations(range(size), mine)]
        dealt, extra = np.zeros((len(chosen), size)), 0
        for row, members in zip(dealt, chosen, strict=True):
            row[members] = 1
    else:
        order = np.argsort(random.random((_DEALS, size)), axis=1)
        dealt, extra = (order < mine).astype(np.float64), 1
    beyond = apart(dealt @ everyone) >= observed - _TIE
    return np.asarray((extra + beyond.sum(0)) / (extra + len(dealt)), np.float64)


def independent_power(first_trials: int, second_trials: int, first: float, second: float, level: float) -> float:
    """Return the exact power of Fisher's test for two independent samples of these sizes and true rates."""
    return _fisher_power(_fisher_rejects(first_trials, second_trials, level), first, second)


def independent_detectable(
    first_trials: int, second_trials: int, rate: float, level: float, wanted: float = POWER
) -> float | None:
    """Return the smallest difference around a mean rate that Fisher's test shows with this power, to a point."""
    rejects = _fisher_rejects(first_trials, second_trials, level)

    def enough(points: int) -> bool:
        first = min(1.0, max(points / 100, rate + points / 200))
        return _fisher_power(rejects, first, first - points / 100) >= wanted

    points = least(enough, 1, 100)
    return None if points is None else points / 100


def independent_trials_needed(first: float, second: float, level: float, wanted: float = POWER) -> int | None:
    """Return the trials that each of two independent samples needs for Fisher's test to tell the rates apart.

    Normal approximation with the correction for continuity (Casagrande, Pike and Smith 1978), which follows the exact
    power closely. None for equal rates.
    """
    if not (math.isfinite(first) and math.isfinite(second)) or first == second:
        return None
    from scipy.stats import norm

    mean, apart = (first + second) / 2, abs(first - second)
    spread = float(norm.isf(level / 2)) * math.sqrt(2 * mean * (1 - mean)) + float(norm.ppf(wanted)) * math.sqrt(
        first * (1 - first) + second * (1 - second)
    )
    plain = (spread / apart) ** 2
    return math.ceil(plain / 4 * (1 + math.sqrt(1 + 4 / (plain * apart))) ** 2)


def _fisher_rejects(first: int, second: int, level: float) -> npt.NDArray[np.bool_]:
    """Return (first + 1, second + 1): whether Fisher's test rejects these successes."""
    from scipy.stats import hypergeom

    rejects = np.zeros((first + 1, second + 1), bool)
    for successes in range(first + second + 1):
        mine = np.arange(max(0, successes - second), min(first, successes) + 1)
        chances = hypergeom(first + second, successes, first).pmf(mine)
        order = np.argsort(chances)
        summed = np.cumsum(chances[order])
        # As likely as this one counts as extreme too: take the sum at the last of the ties.
        last = np.searchsorted(chances[order], chances * (1 + 1e-7), side="right") - 1
        rejects[mine, successes - mine] = summed[last] <= level
    return rejects


def _fisher_power(rejects: npt.NDArray[np.bool_], first: float, second: float) -> float:
    from scipy.stats import binom

    trials = rejects.shape[0] - 1, rejects.shape[1] - 1
    mine, theirs = (binom.pmf(np.arange(n + 1), n, rate) for n, rate in zip(trials, (first, second), strict=True))
    return float(mine @ rejects @ theirs)
