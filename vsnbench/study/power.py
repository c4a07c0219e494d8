"""Power of a study's design, by simulation of its own test.

One simulated arm succeeds at the assumed rate plus half the difference, the other at the rate minus half. Correlations
between cells and models are assumed or estimated from a record (`vsnbench.statistics.power.Resemblance`). The
correction for all pairs is that of the study. With more than two arms the power is that of one pair with the others
equal, at Holm's strictest step, and therefore a lower bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsnbench.statistics.balanced import paired_intervals
from vsnbench.statistics.clustered import MIN_UNITS
from vsnbench.statistics.power import Design, Resemblance, common_parts, least, named_models
from vsnbench.statistics.sequential.betting import as_share, capital
from vsnbench.statistics.sequential.group_sequential import look_weights, sequential_signs
from vsnbench.study.decision import arm_pairs
from vsnbench.study.file import StudyFile
from vsnbench.study.looks import confidence_of, looks_of
from vsnbench.study.units import bet_fractions

Floats = npt.NDArray[np.float64]
DIFFERENCES = (0.0, 0.05, 0.10, 0.15, 0.20, 0.30, 0.40)
ASSUMED = Resemblance(start=0.1, cell=0.3, models=0.5, assumed=True)
"""Assumed correlations without data."""
SAMPLES = 2000
"""Simulated studies for each difference: a standard error of at most 1.1 points."""
_MORE, _QUICK_STARTS = 3, 16
"""Up to this number of positions a study is simulated so fast that this many times more of them are."""
_FEW_SAMPLES = 600
_MOST_STARTS = 200


@dataclass(frozen=True, slots=True)
class PlannedPower:
    """Power of a design for one true difference."""

    difference: float
    power: float
    """Share of simulated studies in which the primary test finds the better arm; NaN for equal arms. For equivalence
    and non-inferiority the share that shows it; NaN if the difference reaches the margin."""
    wrong: float
    """Share in which it names the worse arm, or any arm if both are equal; or shows what is not true."""
    blocks: float
    """Mean number of completed blocks of the shared goals."""
    decided_at: float | None
    """Median number of units until the better arm is found; None for a whole plan, or if it is never found."""


def pairs_of(study: StudyFile) -> int:
    """Return the number of comparisons of the primary analysis."""
    return len(arm_pairs(study))


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


def simulated_studies(study: StudyFile, starts: int) -> int:
    """Return the number of simulated studies for each difference: 6,000, or 2,000 of many positions or of bets."""
    return SAMPLES * (_MORE if study.about is None and starts <= _QUICK_STARTS else 1)


def planned_power(
    study: StudyFile, design: Design, differences: Sequence[float] = DIFFERENCES
) -> tuple[PlannedPower, ...]:
    """Return the power of a design for several true differences, from `simulated_studies` each."""
    if study.by_looks or study.of_margin:
        return tuple(_looked(study, design, difference) for difference in differences)
    if study.stopping == "decided":
        return tuple(_decided(study, design, difference) for difference in differences)
    blocks, samples = design.starts * design.cells * design.trials, simulated_studies(study, design.starts)
    return tuple(
        PlannedPower(
            difference,
            *_shares(difference, *named_models(design, difference, margin=study.margin, samples=samples)),
            blocks,
            None,
        )
        for difference in differences
    )


def _shares(difference: float, better: float, worse: float) -> tuple[float, float]:
    """Return the shares of right and of wrong winners."""
    return (better, worse) if difference else (math.nan, better + worse)


def _decided(study: StudyFile, design: Design, difference: float) -> PlannedPower:
    random = np.random.default_rng(0)
    arms = simulated_arms(random, design, difference, samples=SAMPLES)
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


def _looked(study: StudyFile, design: Design, difference: float) -> PlannedPower:
    looks = looks_of(study, design.starts)
    found = _simulated(study, design, difference, looks, simulated_studies(study, design.starts))
    right = found.signs > 0
    shown, blocks = float(right.mean()), float(found.units.mean()) * design.cells * design.trials
    decided_at = float(np.median(found.units[right])) if right.any() and study.by_looks else None
    if study.of_margin:
        true = difference < study.margin
        shares = (shown, 0.0) if true else (math.nan, shown)
        return PlannedPower(difference, *shares, blocks, decided_at)
    return PlannedPower(difference, *_shares(difference, shown, float((found.signs < 0).mean())), blocks, decided_at)


def _simulated(
    study: StudyFile, design: Design, difference: float, looks: Sequence[int], samples: int
) -> "DecidedStudies":
    """Simulate studies at looks; for non-inferiority the arm is worse by the difference."""
    random, batches = np.random.default_rng(0), -(-samples // SAMPLES)  # batches bound the memory
    each = min(samples, SAMPLES)
    means = np.concatenate([simulated_arms(random, design, difference, each).mean(-1) for _ in range(batches)], axis=1)
    if study.primary.kind == "non-inferiority":
        means = means[::-1]
    return looked_studies(study, means, design.trials, looks)


def needed_starts(study: StudyFile, design: Design) -> int | None:
    """Return the starting positions that a whole plan needs for its power, by simulation; None above 200.

    The true difference is that of the plan, or 0 for equivalence and non-inferiority.
    """
    difference = 0.0 if study.of_margin else study.difference

    def enough(starts: int) -> bool:
        found = _simulated(study, replace(design, starts=starts), difference, (starts,), _FEW_SAMPLES)
        return float((found.signs > 0).mean()) >= study.power

    return least(enough, MIN_UNITS, _MOST_STARTS)


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


def looked_studies(study: StudyFile, means: Floats, trials: int, looks: Sequence[int]) -> DecidedStudies:
    """Simulate the rule of `vsnbench.study.looks` for two arms of complete starting positions.

    Args:
        study: the plan: its question, alpha over all pairs, margin and spending.
        means: (2, samples, starts, cells) success rate or progress of both arms in each cell, in running order.
        trials: trials of each arm in a cell.
        looks: planned looks, the last after all starting positions.

    Returns:
        Signs: 1 if the first arm is better or what the study asks is shown, -1 if the second is better. Units: starting
        positions that were run.
    """
    level, margin = study.alpha / pairs_of(study), study.margin
    differences = (means[0] - means[1]).mean(2)
    signs = _signs_at(study, differences, looks, level)
    answer, units = np.zeros(len(differences), np.int8), np.full(len(differences), looks[-1])
    for place, (look, weight) in enumerate(zip(looks, look_weights(looks, study.spending), strict=True)):
        if look < MIN_UNITS:
            continue
        found = paired_intervals(means[0][:, :look], means[1][:, :look], trials, confidence_of(study, weight))
        if study.of_margin:
            within = (found.low > -margin) & ((found.high < margin) | (study.primary.kind == "non-inferiority"))
            named = np.where(within & (signs[:, place] > 0), 1, 0)
        else:
            named = np.where((signs[:, place] > 0) & (found.low > margin), 1, 0)
            named = np.where((signs[:, place] < 0) & (found.high < -margin), -1, named)
        now = (answer == 0) & (named != 0)
        answer[now], units[now] = named[now], look
    return DecidedStudies(answer, units)


def _signs_at(study: StudyFile, differences: Floats, looks: Sequence[int], level: float) -> npt.NDArray[np.int8]:
    """Return (samples, looks) the answers of the tests alone."""
    margin, spending = study.margin, study.spending
    if study.of_margin:
        above = sequential_signs(differences + margin, looks, level, spending) > 0
        if study.primary.kind == "equivalence":
            above &= sequential_signs(differences - margin, looks, level, spending) < 0
        return above.astype(np.int8)
    signs = sequential_signs(differences - margin, looks, level / 2, spending)
    if not margin:
        return signs
    below = sequential_signs(differences + margin, looks, level / 2, spending) < 0
    return np.where(signs > 0, 1, np.where(below, -1, 0)).astype(np.int8)


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
