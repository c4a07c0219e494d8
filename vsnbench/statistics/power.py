"""What a design can show: its power, the difference it would find, the starting positions or repetitions it lacks.

Never the "observed power" of the difference that was seen, which only restates its p-value (Hoenig and Heisey 2001).
For paired designs the test in use, flipping the signs of whole starting positions, is run on simulated outcomes at the
level in force. Two independent samples are in `vsnbench.statistics.power_independent`.

Simulated outcomes follow a threshold model: an episode succeeds where a normal variable exceeds what its rate asks for,
made up of a part common to the starting position, one common to the cell, and chance; both common parts are correlated
between the models. Correlations of outcomes become those of the normal variables by sin(pi phi / 2), exact at a rate of
one half (Sheppard 1899).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.clustered import Outcomes, arrays
from vsnbench.statistics.paired import PairedOutcomes
from vsnbench.statistics.rates import POWER

Floats = npt.NDArray[np.float64]
MOST_STARTS = 1000
MOST_TRIALS = 20
SAMPLES = 600
_FLIPS = 1999
_ASSUMED = 0.5


@dataclass(frozen=True, slots=True)
class Resemblance:
    """How outcomes resemble each other: correlations, 0 to 1."""

    start: float
    """Of one model's episodes from one starting position in different cells."""
    cell: float
    """Of one model's episodes in one cell; not below `start`."""
    models: float
    """Of what is common to a cell, between the two models."""
    assumed: bool = False
    """`cell` is a guess: no cell was tried twice."""

    @property
    def of_normals(self) -> tuple[float, float]:
        """Correlations of the normal variables behind the outcomes, of a starting position and of a cell."""
        of_cell = math.sin(math.pi / 2 * self.cell)
        return min(of_cell, math.sin(math.pi / 2 * self.start)), of_cell


@dataclass(frozen=True, slots=True)
class Design:
    """A paired comparison as it was or could be run."""

    starts: int
    cells: int
    """Goals from each starting position."""
    trials: int
    """Episodes of each model in each cell."""
    rate: float
    """Mean of the two success rates."""
    resemblance: Resemblance
    level: float = 0.05
    """Below which a p-value counts: 0.05 divided by the questions asked together."""


def design_of(outcomes: PairedOutcomes, level: float) -> Design:
    """Return the design that paired outcomes came from, with the resemblance that they show; at least one cell."""
    clusters, mine, trials = arrays(outcomes.first.cells)
    _, theirs, other_trials = arrays(outcomes.second.cells)
    starts = int(clusters.max()) + 1
    rate = float(mine.mean() + theirs.mean()) / 2
    return Design(
        starts=starts,
        cells=max(1, round(len(mine) / starts)),
        trials=max(1, round(float(np.median(np.concatenate([trials, other_trials]))))),
        rate=min(0.99, max(0.01, rate)),
        resemblance=resemblance(outcomes),
        level=level,
    )


def resemblance(outcomes: PairedOutcomes) -> Resemblance:
    """Estimate the correlations of outcomes by their moments; where no cell was tried twice, one half is assumed."""
    alone = own_resemblance(outcomes.first, outcomes.second)
    mine, theirs = (arrays(side.cells)[1] for side in (outcomes.first, outcomes.second))
    total = sum(float(side.mean()) * (1 - float(side.mean())) for side in (mine, theirs)) / 2
    if total <= 0 or alone.cell <= 0:
        return alone
    common = float(np.mean((mine - mine.mean()) * (theirs - theirs.mean()))) / total
    return replace(alone, models=min(1.0, max(0.0, common / alone.cell)))


def own_resemblance(*sides: Outcomes) -> Resemblance:
    """Estimate how each model's outcomes resemble its own, averaged over the models; between them it says nothing."""
    cell, start, spread = [], [], []
    for side in sides:
        clusters, means, times = arrays(side.cells)
        rate = float(means.mean())
        spread.append(rate * (1 - rate))
        cell += list(_within(means, times, rate))
        start += list(_across(clusters, means, rate))
    total = sum(spread) / len(spread)
    if total <= 0:
        return Resemblance(0.0, _ASSUMED, 0.0, assumed=True)
    repeated = bool(cell)
    of_start = min(1.0, max(0.0, float(np.mean(start)) / total)) if start else 0.0
    of_cell = min(1.0, max(of_start, float(np.mean(cell)) / total)) if repeated else max(of_start, _ASSUMED)
    return Resemblance(of_start, of_cell, 0.0, not repeated)


def _within(means: Floats, trials: Floats, rate: float) -> Floats:
    """Return the products of deviations of two episodes of one cell, averaged within each cell tried twice or more."""
    some = trials > 1
    n, p = trials[some], means[some]
    pairs = n * p * (n * p - 1) / (n * (n - 1))  # in which both succeeded
    return np.asarray(pairs - 2 * rate * p + rate * rate, np.float64)


def _across(clusters: npt.NDArray[np.int64], means: Floats, rate: float) -> Floats:
    """Return the products of deviations of two cells of one cluster, averaged within each cluster of several cells."""
    apart = means - rate
    sums, squares = np.bincount(clusters, weights=apart), np.bincount(clusters, weights=apart**2)
    cells = np.bincount(clusters)
    some = cells > 1
    return np.asarray((sums[some] ** 2 - squares[some]) / (cells[some] * (cells[some] - 1)), np.float64)


def power(design: Design, difference: float, seed: int = 0) -> float:
    """Return how often the paired test finds a true difference of success rates, by 600 simulated experiments."""
    random = np.random.default_rng(seed)
    first = min(0.999, max(0.001, design.rate + difference / 2))
    second = min(0.999, max(0.001, first - difference))
    sums = _simulate(random, design, min(0.999, second + difference), second)
    return float(np.mean(_p_values(random, sums) <= design.level))


def detectable(design: Design, wanted: float = POWER) -> float | None:
    """Return the smallest difference of rates that the design shows with this power, to a point; None for none."""
    points = least(lambda step: power(design, step / 100) >= wanted, 1, 99)
    return None if points is None else points / 100


def starts_needed(design: Design, difference: float, wanted: float = POWER) -> int | None:
    """Return how many starting positions in all would show the difference; None beyond 1,000."""
    return least(lambda starts: power(replace(design, starts=starts), difference) >= wanted, 2, MOST_STARTS)


def trials_needed(design: Design, difference: float, wanted: float = POWER) -> int | None:
    """Return how many episodes a cell, of each model, would show it; None where 20 would not: new starts would."""
    return least(lambda trials: power(replace(design, trials=trials), difference) >= wanted, 1, MOST_TRIALS)


def least_p(starts: int) -> float:
    """Return the least two-sided p-value that flipping the signs of so many starting positions can reach."""
    return float(min(1.0, 2.0 ** (1 - starts)))


def fewest_starts(level: float) -> int:
    """Return how many starting positions it takes for a p-value below this level at all."""
    return next(starts for starts in range(1, 1100) if least_p(starts) < level)


def least(enough: Callable[[int], bool], low: int, high: int) -> int | None:
    """Return the least whole number of low to high that is enough, by doubling and halving."""
    top = low
    while not enough(top):
        if top >= high:
            return None
        low, top = top + 1, min(high, 2 * top)
    while low < top:
        middle = (low + top) // 2
        low, top = (low, middle) if enough(middle) else (middle + 1, top)
    return top


def _simulate(random: np.random.Generator, design: Design, first: float, second: float) -> Floats:
    """Return (samples, starts): sum over the cells of the first's rate less the second's."""
    alike = design.resemblance
    shape = (SAMPLES, design.starts, design.cells)
    of_start, of_cell = alike.of_normals
    models = math.sin(math.pi / 2 * alike.models)
    shared = common_parts(random, shape, of_start, of_cell)
    sums = np.zeros(shape[:2])
    for rate, sign in ((first, 1), (second, -1)):
        own = common_parts(random, shape, of_start, of_cell)
        common = math.sqrt(models) * shared + math.sqrt(1 - models) * own
        sums += sign * drawn_rates(random, rate, common, of_cell, design.trials)
    return sums


def drawn_rates(random: np.random.Generator, rate: float, common: Floats, of_cell: float, trials: int) -> Floats:
    """Return (samples, starts): the sum over the cells of one model's success rate.

    Args:
        random: where the chances come from.
        rate: the true success rate.
        common: (samples, starts, cells) what is common to a cell, of variance `of_cell`.
        of_cell: correlation of the normal variables of two episodes of a cell.
        trials: episodes a cell.
    """
    from scipy.special import ndtr, ndtri

    chance = ndtr((common + ndtri(rate)) / math.sqrt(max(1e-9, 1 - of_cell)))
    return np.asarray(random.binomial(trials, chance).sum(2) / trials, np.float64)


def common_parts(random: np.random.Generator, shape: tuple[int, int, int], of_start: float, of_cell: float) -> Floats:
    """Return what is common to each cell of (samples, starts, cells), part of it common to the starting position."""
    start = math.sqrt(of_start) * random.standard_normal((*shape[:2], 1))
    return np.asarray(start + math.sqrt(of_cell - of_start) * random.standard_normal(shape), np.float64)


def _p_values(random: np.random.Generator, sums: Floats) -> Floats:
    """Return the p-value of each sample, (samples,): by random sign flips, or Student's t where there are many."""
    starts = sums.shape[1]
    observed = np.abs(sums.sum(1))
    if starts > 40:
        from scipy.stats import t

        spread = np.sqrt((sums**2).sum(1))
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(spread > 0, observed / spread, 0.0)
            student = ratio * np.sqrt((starts - 1) / np.maximum(1e-12, starts - ratio**2))
        return np.asarray(2 * t.sf(student, starts - 1), np.float64)
    signs = random.integers(0, 2, (_FLIPS, starts)) * 2.0 - 1.0
    beyond = np.abs(signs @ sums.T) >= observed - 1e-9
    return np.asarray((1 + beyond.sum(0)) / (_FLIPS + 1), np.float64)
