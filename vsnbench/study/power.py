"""What a study's design can show: its power over true differences, by simulating the design and its own test.

Two arms are simulated on the plan's cells: one succeeds at the rate assumed and half the difference, the other at half
the difference less; how much cells and models resemble each other is assumed or taken from a record
(`vsnbench.statistics.power.Resemblance`). All pairs are corrected for as in the study; with more than two arms the
power is that of one pair with the others equal, at Holm's strictest step, and so a lower bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.betting import as_share, capital
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
    """Return the power of a design over true differences; at least 600 simulated studies each."""
    blocks = design.starts * design.cells * design.trials
    if study.stopping == "plan":
        return tuple(PlannedPower(each, power(design, each, seed), blocks) for each in differences)
    return tuple(_decided(study, design, each, seed) for each in differences)


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
    """Return (samples, blocks): paired differences of single trials, -1, 0 or 1, block by block in random order.

    After the threshold model of `vsnbench.statistics.power`.
    """
    from scipy.special import ndtr, ndtri

    first = min(0.999, max(0.001, design.rate + difference / 2))
    second = min(0.999, max(0.001, first - difference))
    shape = (samples, design.starts, design.cells)
    of_start, of_cell = design.resemblance.of_normals
    models = math.sin(math.pi / 2 * design.resemblance.models)
    shared = common_parts(random, shape, of_start, of_cell)
    apart = np.zeros((*shape, design.trials))
    for rate, sign in ((first, 1), (second, -1)):
        own = common_parts(random, shape, of_start, of_cell)
        common = math.sqrt(models) * shared + math.sqrt(1 - models) * own
        chance = ndtr((common + ndtri(rate)) / math.sqrt(max(1e-9, 1 - of_cell)))
        apart += sign * (random.random(apart.shape) < chance[..., None])
    return np.asarray(random.permuted(apart.reshape(samples, -1), axis=1), np.float64)
