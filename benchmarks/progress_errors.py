"""Simulates error rates, coverage and cost of studies on progress and on success.

    python benchmarks/progress_errors.py                   5,000 studies a design: minutes on two cores
    python benchmarks/progress_errors.py --write           writes the tables into benchmarks/results/

The design is that of `study_errors.py`: 15 starting positions, 5 goals, and success probabilities that depend on
position and cell. A success has progress 1. A failure has progress 0 with probability 0.3, and otherwise a
beta-distributed value whose mean depends on position and cell. In the column `nearness`, `apart` means that this mean
is independent of the success probability, and `with` that it increases with it. The decisions are those of the package.
"""

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.special import expit
from study_errors import ALPHA, GOALS, OF_START, STARTS, balanced_plan, logit_for

from vsnbench.statistics.balanced import flip_p_values, paired_intervals
from vsnbench.statistics.conclusion import winner_signs
from vsnbench.statistics.sequential.betting import as_share, capital
from vsnbench.study.power import decided_studies, unit_differences
from vsnbench.study.units import bet_fractions

Floats = npt.NDArray[np.float64]
ZEROS, SPREAD, NEARNESS = 0.3, 3.0, 0.5
"""Share of failures without progress; concentration of the others; scale of the logit of their mean."""
RESULT = Path(__file__).resolve().parent / "results" / "2026-11-23-progress-studies.md"


@dataclass(frozen=True, slots=True)
class Arms:
    """Two arms of a simulated design."""

    first: float
    """Mean success rate."""
    second: float
    strength: float
    """Standard deviation of the logits over positions and cells."""
    together: bool
    """Whether progress in failures increases with the success probability."""
    skewed: bool = False
    """Whether the second arm has the same success probability everywhere."""


def chances_and_nearness(
    random: np.random.Generator, studies: int, rate: float, strength: float, together: bool, starts: int = STARTS
) -> tuple[Floats, Floats]:
    """Return (studies, starts, goals) success probabilities, and means of the failures' nonzero progress."""

    def effects() -> Floats:
        start = OF_START**0.5 * random.standard_normal((studies, starts, 1))
        return np.asarray(start + (1 - OF_START) ** 0.5 * random.standard_normal((studies, starts, GOALS)))

    mean, own = logit_for(rate, strength), effects()
    chance = expit(mean + strength * own)
    if together:
        return chance, expit(NEARNESS * (mean + strength * own))
    return chance, expit(NEARNESS * strength * effects())


def simulated(
    random: np.random.Generator, studies: int, arms: Arms, repetitions: int, starts: int = STARTS
) -> tuple[Floats, Floats, float]:
    """Return (2, studies, starts, goals, repetitions) successes and progress, and the true difference in progress."""
    wins, values, means = [], [], []
    for rate, strength in ((arms.first, arms.strength), (arms.second, 0.0 if arms.skewed else arms.strength)):
        chance, near = chances_and_nearness(random, studies, rate, strength, arms.together, starts)
        near = np.clip(near, 0.02, 0.98)
        won = random.random((*chance.shape, repetitions)) < chance[..., None]
        failed = random.beta(SPREAD * near[..., None], SPREAD * (1 - near[..., None]), won.shape)
        failed[random.random(won.shape) < ZEROS] = 0.0
        wins.append(won)
        values.append(np.where(won, 1.0, failed))
        many, nearness = chances_and_nearness(np.random.default_rng(1), 4000, rate, strength, arms.together)
        means.append(float((many + (1 - many) * (1 - ZEROS) * np.clip(nearness, 0.02, 0.98)).mean()))
    return np.asarray(wins, np.float64), np.asarray(values, np.float64), means[0] - means[1]


def balanced_values(random: np.random.Generator, differences: Floats) -> Floats:
    """Return plans (studies, blocks) of differences with mean 0, with as few blocks changed as possible."""
    found = differences.copy()
    order = np.argsort(random.random(found.shape), axis=1)
    rows = np.arange(len(found))
    left = -found.sum(1)
    for place in order.T:
        value = found[rows, place]
        step = np.where(left > 0, np.minimum(left, 1 - value), np.maximum(left, -1 - value))
        found[rows, place] = value + step
        left = left - step
    return found


@dataclass(frozen=True, slots=True)
class Rates:
    """Shares of studies in percent, for one metric."""

    named: dict[str, float]
    """Share that names a winner, by design; for different arms, the share that names the better arm."""
    covered: dict[str, float]
    """Share whose interval or confidence sequence contains the true difference, by design."""
    blocks: dict[str, float]
    """Mean number of blocks until the decision or the end, by design."""


def rates(studies: int, arms: Arms, repetitions: int) -> tuple[Rates, Rates]:
    """Simulate one design; return the rates for success and for progress."""
    random = np.random.default_rng(
        [repetitions, *(round(100 * x) for x in (arms.first, arms.second, arms.strength)), arms.together, arms.skewed]
    )
    wins, values, truth = simulated(random, studies, arms, repetitions)
    equal = arms.first == arms.second
    return (
        _rates(random, wins, 0.0 if equal else arms.first - arms.second, repetitions, equal=equal, success=True),
        _rates(random, values, 0.0 if equal else truth, repetitions, equal=equal, success=False),
    )


def _rates(
    random: np.random.Generator, outcomes: Floats, truth: float, repetitions: int, *, equal: bool, success: bool
) -> Rates:
    means = outcomes.mean(-1)
    p = flip_p_values((means[0] - means[1]).sum(2))
    found = paired_intervals(means[0], means[1], repetitions, 1 - ALPHA)
    estimate, low, high = found.estimate, found.low, found.high
    signs = {"plan": winner_signs(estimate, low, high, p, ALPHA, 0.0)}
    covered = {"plan": (low <= truth) & (truth <= high)}
    blocks = {"plan": np.full(len(estimate), STARTS * GOALS * repetitions)}
    by_start = unit_differences(outcomes, by_start=True)
    cells = unit_differences(outcomes, by_start=False)
    if equal:
        cells = balanced_plan(random, cells) if success else balanced_values(random, cells)
    cells = random.permuted(cells, axis=1)
    for name, differences, size in (("like these", by_start, None), ("these", cells, cells.shape[1])):
        bets_of = {"by_start": size is None, "of_progress": not success}
        ended = decided_studies(differences, ALPHA, 0.0, **bets_of)
        signs[name] = ended.signs
        blocks[name] = ended.units * (GOALS * repetitions if size is None else 1)
        fractions = bet_fractions(**bets_of)
        centre = np.full(len(differences), truth) if size is None else differences.mean(1)
        shares, means_tested = as_share(differences), as_share(centre)
        bets = [capital(shares, means_tested, size, fractions), capital(1 - shares, 1 - means_tested, size, fractions)]
        covered[name] = np.maximum(*bets).max(-1) < 2 / ALPHA
    return Rates(
        {name: 100 * float(((sign != 0) if equal else (sign > 0)).mean()) for name, sign in signs.items()},
        {name: 100 * float(np.mean(inside)) for name, inside in covered.items()},
        {name: float(np.mean(run)) for name, run in blocks.items()},
    )


Job = Callable[[], str]
"""Returns one line of a table."""
DESIGNS = ("plan", "like these", "these")


def cells_of(values: dict[str, float], places: int = 1) -> str:
    """Return the values of all designs in one table cell."""
    return " ".join(f"{values[name]:.{places}f}" for name in DESIGNS)


def null_line(studies: int, arms: Arms, repetitions: int) -> str:
    """Return a line of the table of equal arms."""
    success, progress = rates(studies, arms, repetitions)
    kind = "independent cells" if not arms.strength else "B the same everywhere" if arms.skewed else "both by position"
    return (
        f"| {kind} | {arms.first} | {arms.strength:g} | {repetitions} | {'with' if arms.together else 'apart'} "
        f"| {cells_of(success.named)} | {cells_of(progress.named)} "
        f"| {cells_of(success.covered)} | {cells_of(progress.covered)} |"
    )


def null_table(studies: int) -> tuple[list[str], list[Job]]:
    """Return the header of the table of equal arms, and the jobs for its lines."""
    head = [
        "| arms | rate | logit SD | reps | nearness | false, success | **progress** | covered, succ. | **progress** |",
        "| --- | ---: | ---: | ---: | --- | --- | --- | --- | --- |",
    ]
    kinds = [(0.0, False, False)] + [(s, t, False) for s in (1.0, 2.5, 8.0) for t in (False, True)]
    kinds += [(strength, False, True) for strength in (1.0, 2.5, 8.0)]
    return head, [
        partial(null_line, studies, Arms(rate, rate, strength, together, skewed), repetitions)
        for strength, together, skewed in kinds
        for rate in (0.1, 0.3, 0.6, 0.9, 0.95)
        for repetitions in (1, 2, 5)
    ]


def cost_line(studies: int, arms: Arms, repetitions: int) -> str:
    """Return a line of the table of different arms."""
    success, progress = rates(studies, arms, repetitions)
    saved = {name: success.blocks[name] - progress.blocks[name] for name in DESIGNS[1:]}
    return (
        f"| {100 * (arms.first - arms.second):.0f} | {'with' if arms.together else 'apart'} | {arms.strength:g} "
        f"| {repetitions} | {cells_of(success.named, 0)} | {cells_of(progress.named, 0)} "
        f"| {' '.join(f'{success.blocks[name]:.0f}' for name in DESIGNS[1:])} "
        f"| {' '.join(f'{progress.blocks[name]:.0f}' for name in DESIGNS[1:])} "
        f"| {' '.join(f'{saved[name]:+.0f}' for name in DESIGNS[1:])} | {cells_of(progress.covered)} |"
    )


def cost_table(studies: int) -> tuple[list[str], list[Job]]:
    """Return the header of the table of different arms, and the jobs for its lines."""
    head = [
        "| points | near | logit SD | reps | power, succ. | progress | blocks, succ. | progress | saved | covered |",
        "| ---: | --- | ---: | ---: | --- | --- | --- | --- | --- | --- |",
    ]
    return head, [
        partial(cost_line, studies, Arms(0.5 + gap / 2, 0.5 - gap / 2, strength, together), repetitions)
        for gap in (0.15, 0.3)
        for strength in (1.0, 2.5)
        for together in (True, False)
        for repetitions in (1, 2)
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
    parser.add_argument("--only", choices=("equal arms", "different arms"))
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        for name, make in {"equal arms": null_table, "different arms": cost_table}.items():
            if options.only not in (None, name):
                continue
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
