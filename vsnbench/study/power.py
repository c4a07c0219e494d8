"""Power of a study's design, by simulation of its own test.

One simulated arm succeeds at the assumed rate plus half the difference, the other at the rate minus half. Correlations
between cells and models are assumed or estimated from a record (`vsnbench.statistics.power.Resemblance`). The
correction for all pairs is that of the study. With more than two arms the power is that of one pair with the others
equal, at Holm's strictest step, and therefore a lower bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.betting import as_share, capital
from vsnbench.statistics.power import Design, Resemblance, common_parts, named_models
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.units import bet_fractions

Floats = npt.NDArray[np.float64]
DIFFERENCES = (0.0, 0.05, 0.10, 0.15, 0.20, 0.30, 0.40)
ASSUMED = Resemblance(start=0.1, cell=0.3, models=0.5, assumed=True)
"""Assumed correlations without data."""


@dataclass(frozen=True, slots=True)
class PlannedPower:
    """Power of a design for one true difference."""

    difference: float
    power: float
    """Share of simulated studies in which the primary test finds the better arm; NaN for equal arms."""
    wrong: float
    """Share in which it names the worse arm, or any arm if both are equal."""
    blocks: float
    """Mean number of completed blocks of the shared goals."""
    decided_at: float | None
    """Median number of units until the better arm is found; None for a whole plan, or if it is never found."""


def pairs_of(study: StudyFile) -> int:
    """Return the number of comparisons of the primary analysis."""
    return 1 if isinstance(study.primary, Rate) else comb(len(study.arms), 2)


def design_of_study(study: StudyFile, starts: int, rate: float) -> Design:
    """Return the paired design of a study with this number of starting positions."""
    return Design(
        starts=starts,
        cells=len(study.goals),
        trials=study.repetitions,
        rate=rate,
        resemblance=ASSUMED,
        level=study.alpha / pairs_of(study),
    )


def planned_power(
    study: StudyFile, design: Design, differences: Sequence[float] = DIFFERENCES
) -> tuple[PlannedPower, ...]:
    """Return the power of a design for several true differences, from 600 simulated studies each."""
    if study.stopping == "decided":
        return tuple(_decided(study, design, difference) for difference in differences)
    blocks = design.starts * design.cells * design.trials
    return tuple(
        PlannedPower(
            difference, *_shares(difference, *named_models(design, difference, margin=study.margin)), blocks, None
        )
        for difference in differences
    )


def _shares(difference: float, better: float, worse: float) -> tuple[float, float]:
    """Return the shares of right and of wrong winners."""
    return (better, worse) if difference else (math.nan, better + worse)


def _decided(study: StudyFile, design: Design, difference: float) -> PlannedPower:
    random = np.random.default_rng(0)
    arms = simulated_arms(random, design, difference, samples=600)
    by_start = study.by_starting_position
    values = random.permuted(unit_differences(arms, by_start=by_start), axis=1)
    found = decided_studies(values, design.level, study.margin, by_start=by_start)
    blocks_each = design.cells * design.trials if by_start else 1
    right = found.signs > 0
    return PlannedPower(
        difference,
        *_shares(difference, float(right.mean()), float((found.signs < 0).mean())),
        float(found.units.mean()) * blocks_each,
        float(np.median(found.units[right])) if right.any() else None,
    )


@dataclass(frozen=True, slots=True)
class DecidedStudies:
    """Ends of simulated studies with `stopping: decided`."""

    signs: npt.NDArray[np.int8]
    """(samples,) 1 if the first arm is found better, -1 if the second is, 0 otherwise."""
    units: npt.NDArray[np.int64]
    """(samples,) number of completed units (starting positions or blocks)."""


def unit_differences(arms: Floats, *, by_start: bool) -> Floats:
    """Return (samples, units) paired differences of two simulated arms, -1 to 1.

    Args:
        arms: (2, samples, starts, cells, trials) 1 for each success.
        by_start: units are starting positions; otherwise blocks.
    """
    apart = arms[0] - arms[1]
    return np.asarray(apart.mean((2, 3)) if by_start else apart.reshape(len(apart), -1), np.float64)


def decided_studies(
    differences: Floats, level: float, margin: float, *, by_start: bool, of_progress: bool = False
) -> DecidedStudies:
    """Simulate the stopping rule of `vsnbench.study.stopping` for two arms, evaluated after every unit.

    Args:
        differences: (samples, units) in running order.
        level: alpha divided by the number of comparisons.
        margin: difference that a winner must exceed.
        by_start: units are starting positions from an infinite population; otherwise blocks of this plan.
        of_progress: the differences are of progress instead of success.
    """
    shares = as_share(differences)
    size, fractions = None if by_start else shares.shape[1], bet_fractions(by_start=by_start, of_progress=of_progress)
    beyond = float(as_share(margin))
    wealth = [capital(share, beyond, size, fractions) for share in (shares, 1 - shares)]
    over = np.maximum(*wealth) >= 2 / level
    last = np.where(over.any(1), over.argmax(1), shares.shape[1] - 1)
    above, below = (values[np.arange(len(last)), last] for values in wealth)
    # An infinite capital means a lead that the remaining plan cannot reverse: counted, not inferred.
    inferred = over.any(1) & np.isfinite(np.maximum(above, below))
    signs = np.where(inferred, np.where(above >= below, 1, -1), 0)
    return DecidedStudies(signs.astype(np.int8), last + 1)


def simulated_arms(random: np.random.Generator, design: Design, difference: float, samples: int) -> Floats:
    """Return (2, samples, starts, cells, trials): 1 for each success of two arms, the first better by `difference`.

    Uses the threshold model of `vsnbench.statistics.power`.
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
