"""What a study's design can show: its power over true differences, by simulating the design and its own test.

Two arms are simulated on the plan's cells: one succeeds at the rate assumed and half the difference, the other at half
the difference less; how much cells and models resemble each other is assumed or taken from a record
(`vsnbench.statistics.power.Resemblance`). All pairs are corrected for as in the study; with more than two arms the
power is that of one pair with the others equal, at Holm's strictest step, and so a lower bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import comb

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.betting import as_share, capital
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test
from vsnbench.statistics.power import Design, Resemblance, common_parts, power
from vsnbench.study.file import Rate, StudyFile

Floats = npt.NDArray[np.float64]
DIFFERENCES = (0.05, 0.10, 0.15, 0.20, 0.30, 0.40)
ASSUMED = Resemblance(start=0.1, cell=0.3, models=0.5, assumed=True)
"""Cells differ in how hard they are, and what is hard for one model is somewhat hard for another."""


@dataclass(frozen=True, slots=True)
class PlannedPower:
    """What the design makes of one true difference."""

    difference: float
    power: float
    """Share of simulated studies in which the primary test finds the better arm."""
    blocks: float
    """Mean number of blocks of the shared goals that are run."""


def pairs_of(study: StudyFile) -> int:
    """Return how many questions the primary analysis asks together."""
    return 1 if isinstance(study.primary, Rate) else comb(len(study.arms), 2)


def design_of_study(study: StudyFile, starts: int, rate: float, resemblance: Resemblance = ASSUMED) -> Design:
    """Return the paired design of a study with so many starting positions."""
    return Design(
        starts=starts,
        cells=len(study.goals),
        trials=study.repetitions,
        rate=rate,
        resemblance=resemblance,
        level=study.alpha / pairs_of(study),
    )


def planned_power(
    study: StudyFile, design: Design, differences: Sequence[float] = DIFFERENCES, seed: int = 0
) -> tuple[PlannedPower, ...]:
    """Return the power of a design over true differences: 600 simulated studies each, 200 where there is a margin."""
    if study.stopping == "decided":
        return tuple(_decided(study, design, each, seed) for each in differences)
    find = partial(_beyond, study.margin) if study.margin else power
    blocks = design.starts * design.cells * design.trials
    return tuple(PlannedPower(each, find(design, each, seed), blocks) for each in differences)


def _beyond(margin: float, design: Design, difference: float, seed: int) -> float:
    """Return how often the first arm is found better by more than a margin: by the test and by the whole interval."""
    arms = simulated_arms(np.random.default_rng(seed), design, difference, samples=200).sum(-1)
    found = 0
    for first, second in zip(arms[0], arms[1], strict=True):
        outcomes = PairedOutcomes(
            tuple(
                PairedCell(Cell(start, int(first[at]), design.trials), Cell(start, int(second[at]), design.trials))
                for at in np.ndindex(first.shape)
                for start in at[:1]
            )
        )
        found += paired_interval(outcomes, 1 - design.level).low > margin and paired_test(outcomes) <= design.level
    return float(found / arms.shape[1])


def _decided(study: StudyFile, design: Design, difference: float, seed: int) -> PlannedPower:
    random = np.random.default_rng(seed)
    blocks = simulated_blocks(random, design, difference)
    size = blocks.shape[1] if study.of_these_cells else None
    best = capital(as_share(blocks), float(as_share(study.margin)), size)
    over = best >= 2 / design.level
    first = np.where(over.any(1), over.argmax(1), blocks.shape[1] - 1)
    bet = over.any(1) & np.isfinite(best[np.arange(len(best)), first])
    return PlannedPower(difference, float(bet.mean()), float(first.mean() + 1))


def simulated_blocks(random: np.random.Generator, design: Design, difference: float, samples: int = 600) -> Floats:
    """Return (samples, blocks): paired differences of single trials, -1, 0 or 1, block by block in random order."""
    first, second = simulated_arms(random, design, difference, samples).reshape(2, samples, -1)
    return np.asarray(random.permuted(first - second, axis=1), np.float64)


def simulated_arms(random: np.random.Generator, design: Design, difference: float, samples: int) -> Floats:
    """Return (2, samples, starts, cells, trials): 1 for each success of two arms, the first better by `difference`.

    After the threshold model of `vsnbench.statistics.power`.
    """
    from scipy.special import ndtr, ndtri

    first = min(0.999, max(0.001, design.rate + difference / 2))
    second = min(0.999, max(0.001, first - difference))
    shape = (samples, design.starts, design.cells)
    of_start, of_cell = design.resemblance.of_normals
    models = math.sin(math.pi / 2 * design.resemblance.models)
    shared = common_parts(random, shape, of_start, of_cell)
    arms = []
    for rate in (first, second):
        own = common_parts(random, shape, of_start, of_cell)
        common = math.sqrt(models) * shared + math.sqrt(1 - models) * own
        chance = ndtr((common + ndtri(rate)) / math.sqrt(max(1e-9, 1 - of_cell)))
        arms.append(random.random((*shape, design.trials)) < chance[..., None])
    return np.asarray(arms, np.float64)
