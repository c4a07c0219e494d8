"""Power of paired designs: detectable difference, starting positions and repetitions needed.

This is never the "observed power" of the observed difference, which only restates its p-value (Hoenig and Heisey 2001).
The decision rule (sign-flip test and interval together) is applied to simulated outcomes at the level in force. Two
independent samples are in `vsnbench.statistics.power_independent`.

Simulated outcomes follow a threshold model: an episode succeeds if a normal variable exceeds the threshold of its rate.
The variable is the sum of a part common to the starting position, a part common to the cell and an independent part;
both common parts are correlated between the models. Correlations of outcomes become those of the normal variables by
sin(pi phi / 2), which is exact at a rate of one half (Sheppard 1899).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.balanced import paired_intervals
from vsnbench.statistics.clustered import MIN_UNITS, Outcomes, arrays
from vsnbench.statistics.conclusion import winner_signs
from vsnbench.statistics.paired import PairedOutcomes
from vsnbench.statistics.rates import POWER

Floats = npt.NDArray[np.float64]
MAX_STARTS = 1000
MAX_TRIALS = 20
SAMPLES = 600
_FLIPS = 1999
_ASSUMED = 0.5


@dataclass(frozen=True, slots=True)
class Resemblance:
    """Correlations of outcomes, 0 to 1."""

    start: float
    """Of one model's episodes from one starting position in different cells."""
    cell: float
    """Of one model's episodes in one cell; not below `start`."""
    models: float
    """Of the part common to a cell, between the two models."""
    assumed: bool = False
    """`cell` is assumed because no cell has repetitions."""

    @property
    def of_normals(self) -> tuple[float, float]:
        """Correlations of the underlying normal variables for a starting position and a cell."""
        of_cell = math.sin(math.pi / 2 * self.cell)
        return min(of_cell, math.sin(math.pi / 2 * self.start)), of_cell


@dataclass(frozen=True, slots=True)
class Design:
    """Design of a paired comparison."""

    starts: int
    cells: int
    """Goals per starting position."""
    trials: int
    """Episodes of each model per cell."""
    rate: float
    """Mean of the two success rates."""
    resemblance: Resemblance
    level: float = 0.05
    """Significance level: 0.05 divided by the number of comparisons."""


def design_of(outcomes: PairedOutcomes, level: float) -> Design:
    """Return the design of recorded paired outcomes, with the estimated correlations; at least one cell."""
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
    """Estimate the correlations of outcomes by moments; without repetitions 0.5 is assumed for a cell."""
    alone = own_resemblance(outcomes.first, outcomes.second)
    mine, theirs = (arrays(side.cells)[1] for side in (outcomes.first, outcomes.second))
    total = sum(float(side.mean()) * (1 - float(side.mean())) for side in (mine, theirs)) / 2
    if total <= 0 or alone.cell <= 0:
        return alone
    common = float(np.mean((mine - mine.mean()) * (theirs - theirs.mean()))) / total
    return replace(alone, models=min(1.0, max(0.0, common / alone.cell)))


def own_resemblance(*sides: Outcomes) -> Resemblance:
    """Estimate the correlations within each model's outcomes, averaged over the models."""
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
    """Return the mean product of deviations of two episodes of one cell, for each cell with repetitions."""
    some = trials > 1
    n, p = trials[some], means[some]
    pairs = n * p * (n * p - 1) / (n * (n - 1))  # pairs of which both succeeded
    return np.asarray(pairs - 2 * rate * p + rate * rate, np.float64)


def _across(clusters: npt.NDArray[np.int64], means: Floats, rate: float) -> Floats:
    """Return the mean product of deviations of two cells of one cluster, for each cluster with several cells."""
    apart = means - rate
    sums, squares = np.bincount(clusters, weights=apart), np.bincount(clusters, weights=apart**2)
    cells = np.bincount(clusters)
    some = cells > 1
    return np.asarray((sums[some] ** 2 - squares[some]) / (cells[some] * (cells[some] - 1)), np.float64)


def power(design: Design, difference: float, seed: int = 0, *, margin: float = 0.0) -> float:
    """Return the power for a true difference of success rates: the share of `named_models` that is right."""
    return named_models(design, difference, seed, margin=margin)[0]


def named_models(
    design: Design, difference: float, seed: int = 0, *, margin: float = 0.0, samples: int = SAMPLES
) -> tuple[float, float]:
    """Return how often the better and how often the worse model is named, from simulated experiments.

    A model is named by `vsnbench.statistics.conclusion`, by test and interval together, at the level of the design.

    Args:
        design: design of the comparison.
        difference: true difference, 0 to 1.
        seed: seed of the simulation.
        margin: difference that a winner must exceed.
        samples: number of simulated experiments.
    """
    if (design.starts if design.starts > 1 else design.cells) < MIN_UNITS:
        return 0.0, 0.0  # the interval is unknown
    random = np.random.default_rng(seed)
    first = min(0.999, max(0.001, design.rate + difference / 2))
    second = min(0.999, max(0.001, first - difference))
    sides = _simulate(random, design, min(0.999, second + difference), second, samples)
    p = _p_values(random, (sides[0] - sides[1]).sum(2))
    if design.starts == 1:
        sides = sides.swapaxes(2, 3)  # a single position is replaced by its cells
    found = paired_intervals(sides[0], sides[1], design.trials, 1 - design.level)
    signs = winner_signs(found.estimate, found.low, found.high, p, design.level, margin)
    return float(np.mean(signs > 0)), float(np.mean(signs < 0))


def detectable(design: Design) -> float | None:
    """Return the smallest difference found with 80 % power, in steps of 0.01; None if there is none."""
    points = least(lambda step: power(design, step / 100) >= POWER, 1, 99)
    return None if points is None else points / 100


def starts_needed(design: Design, difference: float) -> int | None:
    """Return the total number of starting positions needed for 80 % power; None above 1,000."""
    return least(lambda starts: power(replace(design, starts=starts), difference) >= POWER, 2, MAX_STARTS)


def trials_needed(design: Design, difference: float) -> int | None:
    """Return the episodes per cell and model needed for 80 % power; None above 20."""
    return least(lambda trials: power(replace(design, trials=trials), difference) >= POWER, 1, MAX_TRIALS)


def least_p(starts: int) -> float:
    """Return the smallest two-sided sign-flip p-value with this number of starting positions."""
    return float(min(1.0, 2.0 ** (1 - starts)))


def min_starts(level: float) -> int:
    """Return the smallest number of starting positions that allows a p-value below this level."""
    return next(starts for starts in range(1, 1100) if least_p(starts) < level)


def least(enough: Callable[[int], bool], low: int, high: int) -> int | None:
    """Return the smallest integer in [low, high] that is enough, by doubling and bisection."""
    top = low
    while not enough(top):
        if top >= high:
            return None
        low, top = top + 1, min(high, 2 * top)
    while low < top:
        middle = (low + top) // 2
        low, top = (low, middle) if enough(middle) else (middle + 1, top)
    return top


def _simulate(random: np.random.Generator, design: Design, first: float, second: float, samples: int) -> Floats:
    """Return (2, samples, starts, cells): success rate of each model in each cell."""
    alike = design.resemblance
    shape = (samples, design.starts, design.cells)
    of_start, of_cell = alike.of_normals
    models = math.sin(math.pi / 2 * alike.models)
    shared = common_parts(random, shape, of_start, of_cell)
    sides = []
    for rate in (first, second):
        own = common_parts(random, shape, of_start, of_cell)
        common = math.sqrt(models) * shared + math.sqrt(1 - models) * own
        sides.append(_drawn_cells(random, rate, common, of_cell, design.trials))
    return np.asarray(sides, np.float64)


def drawn_rates(random: np.random.Generator, rate: float, common: Floats, of_cell: float, trials: int) -> Floats:
    """Return (samples, starts): sum over the cells of one model's simulated success rates.

    Args:
        random: random generator.
        rate: true success rate.
        common: (samples, starts, cells) part common to each cell, with variance `of_cell`.
        of_cell: correlation of the normal variables of two episodes of a cell.
        trials: episodes per cell.
    """
    return np.asarray(_drawn_cells(random, rate, common, of_cell, trials).sum(2), np.float64)


def _drawn_cells(random: np.random.Generator, rate: float, common: Floats, of_cell: float, trials: int) -> Floats:
    """Return (samples, starts, cells): one model's simulated success rate in each cell."""
    from scipy.special import ndtr, ndtri

    chance = ndtr((common + ndtri(rate)) / math.sqrt(max(1e-9, 1 - of_cell)))
    return np.asarray(random.binomial(trials, chance) / trials, np.float64)


def common_parts(random: np.random.Generator, shape: tuple[int, int, int], of_start: float, of_cell: float) -> Floats:
    """Draw the part common to each cell of (samples, starts, cells), including that of the starting position."""
    start = math.sqrt(of_start) * random.standard_normal((*shape[:2], 1))
    return np.asarray(start + math.sqrt(of_cell - of_start) * random.standard_normal(shape), np.float64)


def _p_values(random: np.random.Generator, sums: Floats) -> Floats:
    """Return the p-value of each sample, (samples,): random sign flips, or Student's t above 40 positions."""
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
