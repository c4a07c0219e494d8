"""Simulates the false decisions and the power of study designs.

    python benchmarks/study_errors.py                   5,000 studies a design: minutes on two cores
    python benchmarks/study_errors.py --studies 1000    fewer studies, for a quick check
    python benchmarks/study_errors.py --workers 16      lines on several processes
    python benchmarks/study_errors.py --write           writes the tables into benchmarks/results/

Each study has two arms, 15 starting positions, 5 goals, 1, 2 or 5 repetitions and alpha 5 %. Success probabilities are
logit-normal: 70 % of the variance is common to a starting position, the rest belongs to a cell. Each arm has its own
effects, so the arms differ from position to position and are equal on average over the population of positions. "B the
same everywhere" gives only arm A such effects, which skews the differences. The decisions are those of the package:
`vsnbench.statistics.conclusion` for a complete plan, and `vsnbench.study.power.decided_studies` for a study with
interim looks (a test checks it against `vsnbench.study.stopping`). The tables show percentages.
"""

import argparse
import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.special import expit

from vsnbench.statistics.balanced import flip_p_values, paired_intervals
from vsnbench.statistics.conclusion import winner_signs
from vsnbench.study.power import decided_studies, unit_differences

Floats = npt.NDArray[np.float64]
ALPHA = 0.05
STARTS, GOALS = 15, 5
REPETITIONS = (1, 2, 5)
RATES = (0.1, 0.3, 0.6, 0.9, 0.95)
STRENGTHS = (0.0, 1.0, 2.5, 4.0, 8.0)
"""Standard deviations of the logits; with 0, all cells of an arm have the same probability."""
DIFFERENCES = (0.15, 0.3, 0.4, 0.6)
OF_START = 0.7
RESULT = Path(__file__).resolve().parent / "results" / "2026-11-23-study-errors.md"


@dataclass(frozen=True, slots=True)
class Arms:
    """Two arms of a simulated design."""

    first: float
    """Mean success rate of the first arm."""
    second: float
    strength: float
    """Standard deviation of the logits."""
    skewed: bool = False
    """Whether the second arm has the same success probability everywhere."""


def logit_for(rate: float, strength: float) -> float:
    """Return the mean logit that gives this mean success rate."""
    points, weights = np.polynomial.hermite_e.hermegauss(101)
    weights = weights / weights.sum()
    return float(brentq(lambda mean: float(weights @ expit(mean + strength * points)) - rate, -90, 90))


def chances(random: np.random.Generator, studies: int, rate: float, strength: float, starts: int) -> Floats:
    """Return (studies, starts, goals) success probabilities of one arm."""
    start = math.sqrt(OF_START) * random.standard_normal((studies, starts, 1))
    cell = math.sqrt(1 - OF_START) * random.standard_normal((studies, starts, GOALS))
    return np.asarray(expit(logit_for(rate, strength) + strength * (start + cell)), np.float64)


def simulated(random: np.random.Generator, studies: int, arms: Arms, repetitions: int, starts: int = STARTS) -> Floats:
    """Return (2, studies, starts, goals, repetitions): 1 for each success."""
    strengths = (arms.strength, 0.0 if arms.skewed else arms.strength)
    sides = [
        random.random((studies, starts, GOALS, repetitions)) < chances(random, studies, rate, sd, starts)[..., None]
        for rate, sd in zip((arms.first, arms.second), strengths, strict=True)
    ]
    return np.asarray(sides, np.float64)


def balanced_plan(random: np.random.Generator, differences: Floats) -> Floats:
    """Return plans (studies, blocks) with mean 0, with as few random blocks changed as possible.

    The null hypothesis about these cells includes every plan with mean 0.
    """
    total = differences.sum(1)
    toward = -np.sign(total)[:, None]
    movable = differences * toward < 1  # blocks not yet at the largest difference in that direction
    order = np.argsort(np.where(movable, random.random(differences.shape), 2.0), axis=1)
    rank = np.argsort(order, axis=1)
    return np.asarray(differences + toward * (rank < np.abs(total)[:, None]), np.float64)


@dataclass(frozen=True, slots=True)
class Shares:
    """Shares of studies that name a winner: the first arm or the second."""

    test_alone: tuple[float, float]
    plan: tuple[float, float]
    like_these: tuple[float, float]
    these: tuple[float, float]
    """With equal arms, over plans with mean 0; otherwise over all plans."""
    starts_run: float
    """Mean number of starting positions that a study about cells like these runs."""
    blocks_run: float
    """Mean share of blocks that a study about these cells runs."""
    opposed: float
    """Share in which a complete plan and a study about cells like these name different winners."""


def shares(studies: int, arms: Arms, repetitions: int, starts: int = STARTS) -> Shares:
    """Simulate one design and return its shares of decisions."""
    seed = [repetitions, starts, round(100 * arms.first), round(100 * arms.second), round(10 * arms.strength)]
    random = np.random.default_rng([*seed, int(arms.skewed)])
    outcomes = simulated(random, studies, arms, repetitions, starts)
    means = outcomes.mean(-1)
    p = flip_p_values((means[0] - means[1]).sum(2))
    found = paired_intervals(means[0], means[1], repetitions, 1 - ALPHA)
    plan = winner_signs(found.estimate, found.low, found.high, p, ALPHA, 0.0)
    alone = np.where(p <= ALPHA, np.sign(found.estimate), 0)
    like = decided_studies(unit_differences(outcomes, by_start=True), ALPHA, 0.0, by_start=True)
    blocks = unit_differences(outcomes, by_start=False)
    if arms.first == arms.second:
        blocks = balanced_plan(random, blocks)
    these = decided_studies(random.permuted(blocks, axis=1), ALPHA, 0.0, by_start=False)

    def of(signs: npt.NDArray[np.int8]) -> tuple[float, float]:
        return float((signs > 0).mean()), float((signs < 0).mean())

    return Shares(
        of(np.asarray(alone, np.int8)),
        of(plan),
        of(like.signs),
        of(these.signs),
        float(like.units.mean()),
        float(these.units.mean()) / blocks.shape[1],
        float((plan * like.signs < 0).mean()),
    )


def percent(values: list[tuple[float, float]]) -> str:
    """Return the shares of any winner at each number of repetitions."""
    return " ".join(f"{100 * sum(pair):.1f}" for pair in values)


Job = Callable[[], str]
"""Returns one line of a table."""


def null_line(studies: int, name: str, rate: float, strength: float) -> str:
    """Return a line of the table of false decisions."""
    skewed = name == SKEWED
    found = [shares(studies, Arms(rate, rate, strength, skewed), count) for count in REPETITIONS]
    return (
        f"| {name} | {rate} | {strength:g} | {percent([item.test_alone for item in found])} "
        f"| {percent([item.plan for item in found])} | {percent([item.like_these for item in found])} "
        f"| {percent([item.these for item in found])} | {100 * max(item.opposed for item in found):.1f} |"
    )


SKEWED = "B the same everywhere"


def null_table(studies: int) -> tuple[list[str], list[Job]]:
    """Return the header of the table of false decisions, and the jobs for its lines."""
    head = [
        "| arms | rate | logit SD | test alone | **plan** | **decided, like these** | **decided, these** | opposed |",
        "| --- | ---: | ---: | --- | --- | --- | --- | ---: |",
    ]
    cases = [("both by position" if strength else "independent cells", strength) for strength in STRENGTHS]
    cases += [(SKEWED, strength) for strength in STRENGTHS if strength]
    return head, [partial(null_line, studies, name, rate, strength) for name, strength in cases for rate in RATES]


def power_line(studies: int, starts: int, repetitions: int, strength: float, difference: float) -> str:
    """Return a line of the table of real differences."""
    arms = Arms(0.5 + difference / 2, 0.5 - difference / 2, strength)
    found = shares(studies, arms, repetitions, starts)
    return (
        f"| {repetitions} | {strength:g} | {100 * difference:.0f} | {100 * found.plan[0]:.0f} "
        f"| {100 * found.like_these[0]:.0f} | {found.starts_run:.1f} | {100 * found.these[0]:.0f} "
        f"| {100 * found.blocks_run:.0f} |"
    )


def power_table(studies: int) -> tuple[list[str], list[Job]]:
    """Return the header of the table of real differences, and the jobs for its lines; only correct decisions count."""
    head = [
        "| repetitions | logit SD | difference | plan | like these | starts run | these | blocks run % |",
        "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    designs = ((1, 0.0), (1, 1.0), (1, 2.5), (2, 1.0), (2, 2.5), (5, 1.0), (5, 2.5))
    return head, [
        partial(power_line, studies, STARTS, repetitions, strength, difference)
        for repetitions, strength in designs
        for difference in DIFFERENCES
    ]


def write(name: str, lines: list[str]) -> None:
    """Write a table between its markers in the results page."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    page = RESULT.read_text(encoding="utf-8")
    before, after = page.split(begin)[0], page.split(end)[1]
    RESULT.write_text(before + begin + "\n".join(lines) + "\n" + end + after, encoding="utf-8")


def main() -> None:
    """Simulate the designs and print the tables; write them with --write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--studies", type=int, default=5000, help="number of simulated studies per design")
    parser.add_argument("--workers", type=int, default=1, help="number of processes")
    parser.add_argument("--write", action="store_true", help="write the tables into benchmarks/results/")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        for name, make in {"false decisions": null_table, "power": power_table}.items():
            lines, jobs = make(options.studies)
            print(f"\n{name}", *lines, sep="\n")
            for made in pool.map(_call, jobs):
                lines.append(made)
                print(made, flush=True)
            if options.write:
                write(name, lines)


def _call(job: Job) -> str:
    return job()


if __name__ == "__main__":
    main()
