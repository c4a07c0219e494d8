"""Simulates studies that are analysed at a few looks by sign flips: errors, coverage, power, mean number of positions.

    python benchmarks/group_sequential.py                   2,000 studies a line: an hour on one core
    python benchmarks/group_sequential.py --studies 200     fewer studies, for a quick check
    python benchmarks/group_sequential.py --only equivalence --write

Success probabilities are logit-normal by starting position, model and cell, as in `study_errors.py`; 5 goals. The
decisions are those of the package: `vsnbench.study.power.looked_studies` (a test checks it against
`vsnbench.study.looks`), `decided_studies` for bets about cells like these, and sign flips with the interval for a
complete plan of the same trials. Each value is a percentage of studies unless stated; several values in a cell are
those at 1, 2 and 5 repetitions. "Inverted" is the coverage of intervals from inverting the sign-flip test at the same
looks. With the package `nscore` of PyPI on PYTHONPATH (`pip install --target DIR --no-deps nscore
statistical-comparison-core`) the decisions of N-SCORE are checked against it.
"""

import itertools
import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import expit, logit

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import progress_errors
from study_errors import ALPHA, Arms, chances, logit_for, simulated

from benchmarks.support.n_score import check_with_package, n_score
from benchmarks.support.simulated_tables import Table, print_tables
from tests.study.studies import small_study
from vsnbench.statistics.balanced import paired_intervals
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.power import Design
from vsnbench.statistics.prediction_powered import OnlyPredicted, PredictedCell, powered
from vsnbench.statistics.sequential.group_sequential import look_weights, sequential_signs
from vsnbench.study.file import StudyFile
from vsnbench.study.looks import confidence_of, looks_of
from vsnbench.study.power import (
    ASSUMED,
    DecidedStudies,
    decided_studies,
    looked_studies,
    pairs_of,
    planned_power,
    simulated_arms,
    unit_differences,
)

Floats = npt.NDArray[np.float64]
RESULT = Path(__file__).resolve().parent / "results" / "2026-11-28-group-sequential.md"
REPETITIONS = (1, 2, 5)
GOALS = ("bed", "chair", "sofa", "toilet", "monitor")


def study_of(arms: int = 2, *, decided: bool = True, **changes: Any) -> StudyFile:
    """Return a study of the simulated design."""
    names = [f"m{number}" for number in range(arms)]
    stopping = "decided" if decided else "plan"
    models = {name: {"model": f"lab:{name}"} for name in names}
    return small_study(arms=models, goals=list(GOALS), stopping=stopping, **changes)


def covered_at_end(study: StudyFile, means: Floats, repetitions: int, ended: DecidedStudies, truth: float) -> Floats:
    """Return the coverage of the interval at the end of each study, and of one by inverting sign flips: (2,).

    For progress, whose sign flips take long, the second is NaN.
    """
    looks = looks_of(study, means.shape[2])
    inside, inverted = np.zeros(len(ended.units), bool), np.full(len(ended.units), np.nan)
    if not study.of_progress:
        tested = sequential_signs((means[0] - means[1]).mean(2) - truth, looks, ALPHA / 2, study.spending)
        inverted[:] = 0
    for place, (look, weight) in enumerate(zip(looks, look_weights(looks, study.spending), strict=True)):
        found = paired_intervals(means[0][:, :look], means[1][:, :look], repetitions, 1 - ALPHA * weight)
        here = ended.units == look
        inside |= here & (found.low <= truth + 1e-9) & (found.high >= truth - 1e-9)
        if not study.of_progress:
            inverted += here & (tested[:, place] == 0)
    return np.array([inside.mean(), inverted.mean()])


def outcomes_of(studies: int, arms: Arms, repetitions: int, starts: int) -> Floats:
    """Return the outcomes of a design of two arms: (2, studies, starts, goals, repetitions), always the same ones."""
    seed = [repetitions, starts, round(100 * arms.first), round(100 * arms.second), round(10 * arms.strength)]
    return simulated(np.random.default_rng([*seed, int(arms.skewed)]), studies, arms, repetitions, starts)


def rules(studies: int, arms: Arms, repetitions: int, starts: int) -> dict[str, Any]:
    """Simulate a design of two arms and return its ends by rule, and the coverage."""
    outcomes = outcomes_of(studies, arms, repetitions, starts)
    means, study = outcomes.mean(-1), study_of()
    looked = looked_studies(study, means, repetitions, looks_of(study, starts))
    whole = looked_studies(study_of(decided=False), means, repetitions, (starts,))
    bets = decided_studies(unit_differences(outcomes, by_start=True), ALPHA, 0.0, by_start=True)
    covered = covered_at_end(study, means, repetitions, looked, arms.first - arms.second)
    return {"looks": looked, "bets": bets, "plan": whole, "covered": covered}


def joined(values: list[float], places: int = 1) -> str:
    """Return values of 1, 2 and 5 repetitions in one table cell."""
    return " ".join(f"{value:.{places}f}" for value in values)


def equal_line(studies: int, starts: int, skewed: bool, strength: float, rate: float) -> str:
    """Return a line of the table `equal arms`."""
    found = [rules(studies, Arms(rate, rate, strength, skewed), count, starts) for count in REPETITIONS]
    false = {
        rule: joined([100 * float(np.mean(each[rule].signs != 0)) for each in found])
        for rule in ("looks", "bets", "plan")
    }
    covered = [joined([100 * float(each["covered"][place]) for each in found]) for place in (0, 1)]
    kind = "B the same everywhere" if skewed else "both by position"
    return (
        f"| {starts} | {kind} | {strength:g} | {rate} | {false['looks']} | {false['bets']} | {false['plan']} "
        f"| {covered[0]} | {covered[1]} |"
    )


def different_line(studies: int, starts: int, repetitions: int, strength: float, gap: float) -> str:
    """Return a line of the table `different arms`; only correct decisions count."""
    arms = Arms(0.5 + gap / 2, 0.5 - gap / 2, strength)
    found = rules(studies, arms, repetitions, starts)
    power = {rule: 100 * float(np.mean(found[rule].signs > 0)) for rule in ("looks", "bets", "plan")}
    run = {rule: float(found[rule].units.mean()) for rule in ("looks", "bets")}
    return (
        f"| {starts} | {repetitions} | {strength:g} | {100 * gap:.0f} | {power['looks']:.0f} | {run['looks']:.1f} "
        f"| {power['bets']:.0f} | {run['bets']:.1f} | {power['plan']:.0f} | {100 * found['covered'][0]:.1f} |"
    )


_CHECKED = 10
"""Studies of a line that the package of N-SCORE decides too."""


def n_score_line(studies: int, starts: int, repetitions: int, strength: float, gap: float) -> str:
    """Return a line of the table `N-SCORE`: decisions by position and by block on the outcomes of `different arms`."""
    arms = Arms(0.5 + gap / 2, 0.5 - gap / 2, strength)
    outcomes = outcomes_of(studies, arms, repetitions, starts)
    scores = {len(GOALS) + 1: outcomes.mean((-1, -2)), 2: outcomes.reshape(2, studies, -1)}
    cells = []
    for bins, (first, second) in scores.items():
        check_with_package(first, second, bins, ALPHA / 2, _CHECKED)
        signs, run = n_score(first, second, bins, ALPHA / 2)
        named = 100 * float(np.mean(signs > 0 if gap else signs != 0))
        cells += [f"{named:.1f}", f"{float(run.mean()) * starts / first.shape[1]:.1f}"]
    return f"| {starts} | {repetitions} | {strength:g} | {100 * gap:.0f} | {' | '.join(cells)} |"


def several_line(studies: int, arms: int, starts: int, rate: float, strength: float) -> str:
    """Return a line of the table `several arms`: all equal, and one better by 30 points."""
    study = study_of(arms)
    looks = looks_of(study, starts)
    pairs = list(itertools.combinations(range(arms), 2))
    columns: list[list[float]] = [[] for _ in range(5)]
    for repetitions in REPETITIONS:
        for lead in (0.0, 0.3):
            random = np.random.default_rng(
                [arms, starts, round(100 * rate), round(10 * strength), repetitions, int(lead > 0)]
            )
            rates = [min(0.95, rate + lead), *[rate] * (arms - 1)]
            sides = [_means(random, studies, each, strength, starts, repetitions) for each in rates]
            # Of k true hypotheses Holm rejects none unless one of them falls to alpha / k.
            equal = [pair for pair in pairs if not lead or 0 not in pair]
            mild = study.model_copy(update={"alpha": ALPHA * len(pairs) / len(equal)})
            of_equal = [looked_studies(mild, np.stack((sides[a], sides[b])), repetitions, looks) for a, b in equal]
            named = np.any([found.signs != 0 for found in of_equal], axis=0)
            columns[int(lead > 0)].append(100 * float(named.mean()))
        columns[2].append(_covered_together(study, sides, rates, repetitions, looks))
        first = [looked_studies(study, np.stack((sides[0], sides[b])), repetitions, looks) for b in range(1, arms)]
        columns[3].append(100 * float(np.mean([np.mean(found.signs > 0) for found in first])))
        columns[4].append(float(np.mean(np.max([found.units for found in first], axis=0))))
    shown = ", ".join(str(look) for look in looks)
    cells = [joined(values, places) for values, places in zip(columns, (1, 1, 1, 0, 1), strict=True)]
    return f"| {arms} | {shown} | {rate} | {strength:g} | {' | '.join(cells)} |"


def _covered_together(
    study: StudyFile, sides: list[Floats], rates: list[float], repetitions: int, looks: tuple[int, ...]
) -> float:
    """Return how often the intervals of all pairs at all looks contain the true differences, in percent."""
    inside = np.ones(len(sides[0]), bool)
    for look, weight in zip(looks, look_weights(looks, study.spending), strict=True):
        for a, b in itertools.combinations(range(len(sides)), 2):
            confidence = confidence_of(study, weight)
            found = paired_intervals(sides[a][:, :look], sides[b][:, :look], repetitions, confidence)
            truth = rates[a] - rates[b]
            inside &= (found.low <= truth + 1e-9) & (found.high >= truth - 1e-9)
    return 100 * float(inside.mean())


def _means(
    random: np.random.Generator, studies: int, rate: float, strength: float, starts: int, repetitions: int
) -> Floats:
    chance = chances(random, studies, rate, strength, starts)
    return np.asarray(random.binomial(repetitions, chance) / repetitions, np.float64)


def margin_line(
    studies: int, starts: int, margin: float, middle: float, strength: float, *, skewed: bool = False
) -> str:
    """Return a line of the table `equivalence`, with the percentages at 1, 2 and 5 repetitions."""
    questions = {
        "equivalence": {"primary": {"kind": "equivalence"}},
        "non-inferiority": {"primary": {"kind": "non-inferiority", "arm": "m1"}},
    }
    columns = []
    for question, decided in itertools.product(questions, (False, True)):
        study = study_of(decided=decided, margin=margin, **questions[question])
        looks = looks_of(study, starts)
        shares: dict[float, list[float]] = {}
        for true, repetitions in itertools.product((margin, 0.0), REPETITIONS):
            # With B the same everywhere, the better arm is B.
            gap = -true if skewed else true
            arms = Arms(middle + gap / 2, middle - gap / 2, strength, skewed)
            seed = [starts, round(100 * margin), round(1000 * middle), repetitions, int(true > 0), int(skewed)]
            random = np.random.default_rng(seed)
            means = simulated(random, studies, arms, repetitions, starts).mean(-1)
            if question == "non-inferiority" and not skewed:
                means = means[::-1]  # the arm in question is the worse one
            found = looked_studies(study, means, repetitions, looks)
            shares.setdefault(true, []).append(100 * float(np.mean(found.signs > 0)))
        columns += [joined(shares[margin]), joined(shares[0.0], 0)]
    kind = "B the same everywhere" if skewed else "both by position"
    return f"| {starts} | {kind} | {100 * margin:.0f} | {middle} | {strength:g} | {' | '.join(columns)} |"


def progress_line(studies: int, starts: int, strength: float, first: float, second: float) -> str:
    """Return a line of the table `progress`, with the percentages at 1, 2 and 5 repetitions."""
    study, shares = study_of(primary={"metric": "progress"}), []
    for repetitions in REPETITIONS:
        arms = progress_errors.Arms(first, second, strength, together=True)
        seed = [repetitions, starts, *(round(100 * value) for value in (first, second, strength))]
        _, values, truth = progress_errors.simulated(np.random.default_rng(seed), studies, arms, repetitions, starts)
        truth = 0.0 if first == second else truth
        means = values.mean(-1)
        ended = looked_studies(study, means, repetitions, looks_of(study, starts))
        covered = covered_at_end(study, means, repetitions, ended, truth)[0]
        named = np.mean(ended.signs > 0) if first > second else np.mean(ended.signs != 0)
        shares.append((100 * float(named), float(ended.units.mean()), 100 * float(covered), 100 * truth))
    named, run, covered, truths = ([line[place] for line in shares] for place in range(4))
    return (
        f"| {starts} | {first} | {second} | {strength:g} | {truths[0]:+.1f} | {joined(named)} | {joined(run)} "
        f"| {joined(covered)} |"
    )


_STUDIES_BESIDE = 10_000
"""Other simulated studies for a line of `study plan`."""


def planned_line(starts: int, repetitions: int, difference: float, question: dict[str, Any]) -> str:
    """Return a line of the table `study plan`: its numbers, and those of other simulated studies."""
    study = study_of(**question)
    design = Design(starts, len(GOALS), repetitions, 0.5, ASSUMED, study.alpha / pairs_of(study))
    planned = planned_power(study, design, (difference,))[0]
    random, batches = np.random.default_rng(99), range(0, _STUDIES_BESIDE, 2000)
    means = np.concatenate([simulated_arms(random, design, difference, 2000).mean(-1) for _ in batches], axis=1)
    if study.primary.kind == "non-inferiority":
        means = means[::-1]
    ended = looked_studies(study, means, repetitions, looks_of(study, starts))
    run = float(ended.units.mean()) * len(GOALS) * repetitions
    shown = 100 * float(np.mean(ended.signs > 0))
    wrong = 100 * float(np.mean(ended.signs < 0 if difference else ended.signs != 0))
    if study.of_margin:
        wrong = shown if difference >= study.margin else 0.0
    power = "" if planned.power != planned.power else f"{100 * planned.power:.1f} / {shown:.1f}"
    return (
        f"| {study.primary.kind} | {study.stopping} | {len(study.arms)} | {starts} | {repetitions} "
        f"| {100 * difference:.0f} | {power} | {100 * planned.wrong:.1f} / {wrong:.1f} "
        f"| {planned.blocks:.1f} / {run:.1f} |"
    )


TWINS = ("weak", "good", "too good", "opposite")


def twin_line(studies: int, starts: int, real_cells: int, rate: float, strength: float, twin: str) -> str:
    """Return a line of the table `planned twin`: the primary rate of a study with real trials in random cells."""
    seed = [starts, real_cells, round(100 * rate), round(10 * strength), TWINS.index(twin)]
    random = np.random.default_rng(seed)
    chance, own = (chances(random, studies, rate, strength, starts) for _ in range(2))
    real = random.random(chance.shape) < chance
    simulated_there = _twin_chances(twin, chance, own, rate, strength) > random.random(chance.shape)
    cells = starts * len(GOALS)
    place = np.repeat(np.arange(starts), len(GOALS))
    held = np.zeros(2)
    widths, rates, stated = np.zeros(2), np.empty((studies, 2)), 0.0
    for study in range(studies):
        driven = np.zeros(cells, bool)
        driven[random.permutation(cells)[:real_cells]] = True
        outcome, predicted = real[study].ravel(), simulated_there[study].ravel()
        found = powered(
            [
                PredictedCell(Cell(int(place[n]), int(outcome[n]), 1), float(predicted[n]))
                for n in np.flatnonzero(driven)
            ],
            [OnlyPredicted(int(place[n]), float(predicted[n])) for n in np.flatnonzero(~driven)],
        )
        if found is None:
            raise SystemExit(f"{real_cells} real cells are too few")
        intervals = (found.plain_interval, found.interval)
        held += [rate in interval for interval in intervals]
        widths += [interval.high - interval.low for interval in intervals]
        rates[study] = found.plain_rate, found.rate
        stated += found.saved
    errors = ((rates - rate) ** 2).mean(0)
    shown = [f"{value:.1f}" for value in 100 * held / studies] + [f"{value:.1f}" for value in 100 * widths / studies]
    saved, bias = real_cells * (errors[0] / errors[1] - 1), 100 * (rates[:, 1].mean() - rate)
    return (
        f"| {real_cells} of {cells} | {rate} | {strength:g} | {twin} | {' | '.join(shown)} | {bias:+.1f} "
        f"| {stated / studies:.1f} | {saved:.1f} |"
    )


def _twin_chances(twin: str, chance: Floats, own: Floats, rate: float, strength: float) -> Floats:
    """Return the success probabilities of a twin in all cells, from those of the robot and independent ones."""
    middle = logit_for(rate, strength)
    effects, others = logit(chance) - middle, logit(own) - middle
    alike = {"weak": 0.4, "opposite": -1.0}.get(twin, 0.95)
    shift = logit_for(min(0.98, rate + 0.3), strength) - middle if twin == "too good" else 0.0
    return np.asarray(expit(middle + shift + alike * effects + math.sqrt(1 - alike**2) * others), np.float64)


def tables(studies: int) -> dict[str, Table]:
    """Return the header of each table and the jobs for its lines."""
    equal = itertools.product((15, 8), (False, True), (1.0, 2.5), (0.1, 0.3, 0.5, 0.7, 0.9))
    different = itertools.product((15, 8), REPETITIONS, (1.0, 2.5), (0.2, 0.3))
    beside = itertools.product((15,), (1, 5), (1.0, 2.5), (0.0, 0.2, 0.3))
    several = [(3, 15, rate, 2.5) for rate in (0.5, 0.1, 0.9)] + [(5, 15, 0.5, 2.5), (3, 8, 0.5, 2.5)]
    several += [(5, 15, rate, 2.5) for rate in (0.1, 0.9)]
    # Of 23 designs that were tried, the ones with the most errors, and six others.
    margins = [(15, 0.3, 0.3, 2.5), (15, 0.3, 0.8, 1.0), (15, 0.15, 0.8, 1.0), (8, 0.3, 0.8, 2.5)]
    margins += [(15, 0.15, 0.5, 1.0), (8, 0.3, 0.5, 2.5)]
    margins += [(15, 0.15, 0.875, 2.5), (15, 0.15, 0.125, 2.5), (15, 0.2, 0.85, 2.5)]
    skewed = [(15, 0.15, 0.875, 2.5), (15, 0.15, 0.825, 2.5), (15, 0.3, 0.8, 2.5)]
    progress = [(starts, 2.5, rate, rate) for starts in (15, 8) for rate in (0.1, 0.5, 0.9)]
    progress += [(starts, 2.5, 0.65, 0.35) for starts in (15, 8)]
    within: dict[str, Any] = {"primary": {"kind": "equivalence"}, "margin": 0.3}
    no_worse: dict[str, Any] = {"primary": {"kind": "non-inferiority", "arm": "m1"}, "margin": 0.3}
    plans: list[tuple[int, int, float, dict[str, Any]]] = [(15, 1, gap, {}) for gap in (0.0, 0.15, 0.2, 0.3)]
    plans += [(15, 2, gap, {}) for gap in (0.0, 0.2)] + [(8, 2, gap, {}) for gap in (0.0, 0.3)]
    plans += [(15, 1, gap, {"decided": False}) for gap in (0.0, 0.15, 0.2, 0.3)]
    plans += [(15, 2, gap, {"arms": 3}) for gap in (0.0, 0.3)]
    plans += [(15, 1, gap, question) for question in (within, no_worse) for gap in (0.0, 0.15, 0.3)]
    twins = [(15, 30, 0.5, 2.5, twin) for twin in TWINS]
    twins += [(15, 30, rate, 2.5, twin) for rate in (0.1, 0.9) for twin in ("good", "opposite")]
    twins += [(8, 20, 0.5, 2.5, twin) for twin in ("good", "opposite")]
    return {
        "equal arms": (
            [
                (
                    "| positions | arms | logit SD | rate | **false, looks** | false, bets | false, plan "
                    "| **covered** | inverted |"
                ),
                "| ---: | --- | ---: | ---: | --- | --- | --- | --- | --- |",
            ],
            [partial(equal_line, studies, *each) for each in equal],
        ),
        "different arms": (
            [
                (
                    "| positions | reps | logit SD | points | **power, looks** | positions run | power, bets "
                    "| positions run | power, plan | covered |"
                ),
                "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
            ],
            [partial(different_line, studies, *each) for each in different],
        ),
        "N-SCORE": (
            [
                (
                    "| positions | reps | logit SD | points | **named, by position** | positions run "
                    "| **named, by block** | positions run |"
                ),
                "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
            ],
            [partial(n_score_line, studies, *each) for each in beside],
        ),
        "several arms": (
            [
                (
                    "| arms | looks | rate | logit SD | **false, all equal** | **false, one better** "
                    "| **covered together** | power of a pair | positions run |"
                ),
                "| ---: | --- | ---: | ---: | --- | --- | --- | --- | --- |",
            ],
            [partial(several_line, studies, *each) for each in several],
        ),
        "equivalence": (
            [
                (
                    "| positions | arms | margin | mean rate | logit SD | **equivalent, plan** | power | **looks** "
                    "| power | **not inferior, plan** | power | **looks** | power |"
                ),
                "| ---: | --- | ---: | ---: | ---: | --- | --- | --- | --- | --- | --- | --- | --- |",
            ],
            [
                *(partial(margin_line, studies, *each) for each in margins),
                *(partial(margin_line, studies, *each, skewed=True) for each in skewed),
            ],
        ),
        "progress": (
            [
                (
                    "| positions | success of A | of B | logit SD | points of progress | **named** "
                    "| positions run | **covered** |"
                ),
                "| ---: | ---: | ---: | ---: | ---: | --- | --- | --- |",
            ],
            [partial(progress_line, studies, *each) for each in progress],
        ),
        "study plan": (
            [
                "| primary | stopping | arms | positions | reps | points | power | wrong | blocks |",
                "| --- | --- | ---: | ---: | ---: | ---: | --- | --- | --- |",
            ],
            [partial(planned_line, *each) for each in plans],
        ),
        "planned twin": (
            [
                (
                    "| real cells | rate | logit SD | twin | covered, plain | **covered** | width, plain | **width** "
                    "| **bias** | cells saved, stated | **true** |"
                ),
                "| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
            ],
            [partial(twin_line, studies, *each) for each in twins],
        ),
    }


if __name__ == "__main__":
    print_tables(__doc__, tables, RESULT, unit="studies", count=2000)
