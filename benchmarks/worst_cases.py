"""Simulates designs in which intervals and tests are least right, and what they are then.

    python benchmarks/worst_cases.py                   500 samples a line: minutes on one core
    python benchmarks/worst_cases.py --write           writes the tables into benchmarks/results/

Table `rank correlation`: real and simulated success rates of 5 goals from some starting positions. Their logits have an
effect of the position that both share, one of the position in each, and one of the cell that both share. "Single cells"
is the interval of Bonett and Wright, which counts every cell as independent. Table `rate`: exact coverage of the
interval of a rate, the least over the rates from 0.05 to 0.95. Table `test`: a model that succeeds at the same rate
everywhere, and one that always succeeds from some positions and never from others, equal on average. Table
`convenient`: prediction-powered estimates whose real cells are those of the starting positions with the best simulated
results, instead of random ones.
"""

import math
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.special import expit
from scipy.stats import binom, rankdata

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.support.simulated_tables import print_tables
from vsnbench.statistics.agreement import rank_correlation
from vsnbench.statistics.balanced import flip_p_values, paired_intervals
from vsnbench.statistics.clustered import Cell, independent_outcomes, rate_interval
from vsnbench.statistics.conclusion import winner_signs
from vsnbench.statistics.prediction_powered import OnlyPredicted, PredictedCell, powered
from vsnbench.statistics.rates import Proportion

Floats = npt.NDArray[np.float64]
GOALS, ALPHA = 5, 0.05
RESULT = Path(__file__).resolve().parent / "results" / "2026-11-24-worst-cases.md"
DESIGNS = (*((8, 1, 1), (8, 5, 5), (15, 1, 1), (15, 1, 5), (15, 5, 5), (30, 1, 1), (30, 5, 5)),)
"""Starting positions, real and simulated episodes of a cell."""
EFFECTS = ((0.0, 0.0, 1.0), (2.0, 1.0, 1.0), (3.0, 0.5, 0.0), (0.0, 2.0, 0.0))
"""Standard deviations: position, shared; position, own; cell, shared."""


def cell_rates(
    random: np.random.Generator, starts: int, episodes: tuple[int, int], effects: tuple[float, float, float]
) -> list[Floats]:
    """Return the real and the simulated success rates, (starts * goals,) each."""
    shared, own, cell = effects
    common = shared * random.standard_normal((starts, 1)) + cell * random.standard_normal((starts, GOALS))
    chances = [expit(common + own * random.standard_normal((starts, 1))) for _ in episodes]
    return [(random.binomial(n, chance) / n).ravel() for n, chance in zip(episodes, chances, strict=True)]


def rank_line(samples: int, design: tuple[int, int, int], effects: tuple[float, float, float]) -> str:
    """Return a line of the table `rank correlation`."""
    starts, real, simulated = design
    random = np.random.default_rng([*design, *(round(10 * effect) for effect in effects)])
    population = cell_rates(random, 40_000, (real, simulated), effects)
    true = float(np.corrcoef(*(rankdata(side) for side in population))[0, 1])
    clusters = np.repeat(np.arange(starts), GOALS).tolist()
    held = known = single = 0
    width = 0.0
    for _ in range(samples):
        sides = [side.tolist() for side in cell_rates(random, starts, (real, simulated), effects)]
        found = rank_correlation(sides[0], sides[1], clusters)
        if found.interval.known:
            known += 1
            held += true in found.interval
            width += found.interval.high - found.interval.low
            reach = 1.96 * math.sqrt((1 + found.rho**2 / 2) / (len(clusters) - 3))
            single += abs(math.atanh(found.rho) - math.atanh(true)) <= reach
    shown = f"{true:.2f} | {100 * single / known:.1f} | {100 * held / known:.1f} | {width / known:.2f}"
    return f"| {starts} | {real} | {simulated} | {' '.join(f'{effect:g}' for effect in effects)} | {shown} |"


def rate_line(starts: int) -> str:
    """Return a line of the table `rate`, with one episode per position."""
    rates = np.arange(50, 951) / 1000
    intervals = [rate_interval(independent_outcomes(Proportion(k, starts))) for k in range(starts + 1)]
    covered = [
        sum(float(binom.pmf(k, starts, rate)) for k, interval in enumerate(intervals) if rate in interval)
        for rate in rates
    ]
    return f"| {starts} | {100 * np.mean(covered):.1f} | {100 * min(covered):.1f} | {rates[np.argmin(covered)]:.3f} |"


def test_line(samples: int, starts: int, goals: int, repetitions: int, rate: float) -> str:
    """Return a line of the table `test`."""
    random = np.random.default_rng([starts, goals, repetitions, round(100 * rate)])
    shape = (samples, starts, goals)
    always = np.broadcast_to(random.random((samples, starts, 1)) < rate, shape).astype(np.float64)
    even = random.binomial(repetitions, rate, shape) / repetitions
    p = flip_p_values((always - even).sum(2))
    found = paired_intervals(always, even, repetitions, 1 - ALPHA)
    winners = winner_signs(found.estimate, found.low, found.high, p, ALPHA, 0.0)
    alone, named = 100 * np.mean(p <= ALPHA), 100 * np.mean(winners != 0)
    return f"| {starts} | {goals} | {repetitions} | {rate} | {alone:.1f} | {named:.1f} |"


def convenient_line(samples: int, rate: float, *, chosen: bool) -> str:
    """Return a line of the table `convenient`: 75 cells of 15 positions, 5 of them with real trials."""
    random = np.random.default_rng([round(100 * rate), int(chosen)])
    starts, held, bias = np.repeat(np.arange(15), GOALS), 0, 0.0
    for _ in range(samples):
        chance = random.beta(2 * rate, 2 * (1 - rate), 15)
        real = random.random(75) < chance[starts]
        twin = np.where(random.random(75) < 0.6, real, random.random(75) < 0.5)
        best = np.argsort(np.bincount(starts, weights=twin) + 1e-6 * random.random(15))[::-1]
        driven = np.isin(starts, (best if chosen else random.permutation(15))[:5])
        found = powered(
            [PredictedCell(Cell(int(starts[n]), int(real[n]), 1), float(twin[n])) for n in np.flatnonzero(driven)],
            [OnlyPredicted(int(starts[n]), float(twin[n])) for n in np.flatnonzero(~driven)],
        )
        if found is None:
            raise SystemExit("25 cells of 5 positions are enough")
        held += rate in found.interval
        bias += found.rate - rate
    where = "best in simulation" if chosen else "random"
    return f"| {where} | {rate} | {100 * bias / samples:+.0f} | {100 * held / samples:.1f} |"


Job = Callable[[], str]


def tables(samples: int) -> dict[str, tuple[list[str], list[Job]]]:
    """Return the header of each table and the jobs for its lines."""
    return {
        "rank correlation": (
            [
                "| positions | real | simulated | SDs | true | single cells | **by position** | width |",
                "| ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: |",
            ],
            [partial(rank_line, samples, design, effects) for design in DESIGNS for effects in EFFECTS],
        ),
        "rate": (
            ["| positions | coverage, mean | coverage, least | at a rate of |", "| ---: | ---: | ---: | ---: |"],
            [partial(rate_line, starts) for starts in (8, 10, 15, 20, 30)],
        ),
        "test": (
            [
                "| positions | goals | repetitions | rate | test alone | **winner named** |",
                "| ---: | ---: | ---: | ---: | ---: | ---: |",
            ],
            [
                partial(test_line, 4 * samples, *design, rate)
                for design in ((15, 5, 1), (15, 5, 5), (15, 8, 5), (10, 8, 5))
                for rate in (0.7, 0.9, 0.95)
            ],
        ),
        "convenient": (
            ["| real positions | rate | bias, points | coverage |", "| --- | ---: | ---: | ---: |"],
            [
                partial(convenient_line, 2 * samples, rate, chosen=chosen)
                for chosen in (False, True)
                for rate in (0.3, 0.5, 0.8)
            ],
        ),
    }


if __name__ == "__main__":
    print_tables(__doc__, tables, RESULT, unit="samples", count=500)
