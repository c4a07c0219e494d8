"""Primary analysis of a study."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from vsnbench.report.study.planned_twin import powered_by_twin, twin_words
from vsnbench.results.studies.entries import StudyTrialProgress
from vsnbench.statistics.clustered import Cell, Outcomes, arrays, rate_interval
from vsnbench.statistics.conclusion import Conclusion, DifferenceEvidence, conclude
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test
from vsnbench.statistics.prediction_powered import Powered
from vsnbench.statistics.rates import Interval
from vsnbench.study.decision import ArmQuestion, arm_pairs
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.looks import conclusion_of, confidence_of, margin_p
from vsnbench.study.stopping import decide
from vsnbench.study.units import shared_blocks


@dataclass(frozen=True, slots=True)
class PrimaryAnswer:
    """Result for one pair of arms, or one arm and a rate."""

    first: str
    second: str | None
    """None for a fixed rate."""
    cells: int
    """Number of different cells, without repetitions."""
    trials: int
    """Trials of each arm in these cells."""
    successes: tuple[int, int]
    difference: float
    """First rate minus second; for a fixed rate the first rate."""
    low: float
    high: float
    p: float | None
    """Adjusted for all pairs; two-sided, or that of equivalence or non-inferiority. None for a fixed rate that the
    interval decides, and for a lead that was counted instead of tested."""
    counted: bool = False
    """The remaining trials cannot reverse the lead, and no test was decided."""
    open: bool = False
    """No conclusion is possible yet."""
    units: int = 0
    """Complete units (blocks or starting positions) analysed by `decided`; 0 for a whole plan."""
    conclusion: Conclusion = Conclusion.NOT_SHOWN
    """Conclusion of `vsnbench.statistics.conclusion`."""
    metric: str = "success"
    """Metric of `difference`, `low` and `high`: success or progress."""
    means: tuple[float, float] | None = None
    """Mean progress of each arm; None for success."""

    @property
    def winner(self) -> str | None:
        """Better arm according to the primary test; for a fixed rate `first` if its rate is above."""
        return {1: self.first, -1: self.second}.get(self.conclusion.sign)

    @property
    def loser(self) -> str | None:
        """Worse arm according to the primary test; for a fixed rate `first` if its rate is below."""
        return {1: self.second, -1: self.first}.get(self.conclusion.sign)


@dataclass(frozen=True, slots=True)
class Primary:
    """Result of the primary analysis."""

    method: str
    about: str
    """What the inference is about."""
    answers: tuple[PrimaryAnswer, ...]
    cells: int
    """Planned cells of the shared goals, without repetitions."""
    trials: int
    """Planned trials of each arm in these cells."""
    over: str
    """Reason why the study ended before all trials were done, or empty."""
    dropped: Mapping[str, int]
    unit: str = ""
    """Unit of `dropped`: block or starting position."""
    planned_units: int = 0
    looks: tuple[int, ...] = ()
    """Planned looks of sign flips."""
    looked: tuple[int, ...] = ()
    """Looks that took place."""


_Value = Callable[[StudyTrialProgress], float | None]
THESE = "the trials of this plan only, with the chance in their outcomes, and not about the models"
LIKE_THESE = "cells like these: a population of which the plan's starting positions and goals are a sample"


def analyse(
    study: StudyFile, progress: Sequence[StudyTrialProgress], twin: Mapping[tuple[str, int], float] | None = None
) -> Primary:
    """Carry out the planned analysis on the shared goals.

    Args:
        study: the plan.
        progress: its trials.
        twin: simulated success rate of the primary arm by goal and starting position, of a planned twin.
    """
    shared = [trial for trial in progress if trial.trial.goal in study.goals]
    if study.stopping == "decided":
        return _decided(study, shared)
    return _whole_plan(study, shared, twin or {})


def _decided(study: StudyFile, shared: Sequence[StudyTrialProgress]) -> Primary:
    decision = decide(study, shared_blocks(shared, study.goals))
    answers = [_of_question(study, asked, over=bool(decision.over)) for asked in decision.questions]
    replacement = "without" if study.of_these_cells else "with"
    what = (
        "every block" if study.of_these_cells else "every starting position, whose goals and repetitions are one value"
    )
    cells, trials = _planned(shared)
    of = "progress: " if study.of_progress else ""
    method = f"{of}betting confidence sequence {replacement} replacement, at {what}; Holm over all pairs"
    if study.by_looks:
        looks = ", ".join(str(look) for look in decision.looks)
        test = "success rate with repeated intervals" if isinstance(study.primary, Rate) else _tested(study)
        method = (
            f"{test}, at {looks} starting positions with alpha spent as the {study.spending:g}th power of their share"
        )
    return Primary(
        method=method,
        about=THESE if study.of_these_cells else LIKE_THESE,
        answers=tuple(answers),
        cells=cells,
        trials=trials,
        over=decision.over,
        dropped=decision.dropped,
        unit=decision.unit,
        planned_units=decision.planned_units,
        looks=decision.looks,
        looked=decision.looked,
    )


def _of_question(study: StudyFile, asked: ArmQuestion, *, over: bool) -> PrimaryAnswer:
    """Return the answer to a question at its newest look; a lead that was only counted names no winner."""
    rate = study.primary.rate if isinstance(study.primary, Rate) else 0.0
    p = 0.0 if asked.decided and not asked.counted else 1.0  # Holm's decision at an earlier look
    interval = Interval(asked.low - rate, asked.high - rate)
    found = conclude(DifferenceEvidence(asked.difference - rate, interval, p, study.alpha, study.margin))
    if study.by_looks:
        found = asked.conclusion or Conclusion.INCOMPLETE
    return PrimaryAnswer(
        first=asked.first,
        second=asked.second,
        cells=asked.cells,
        trials=asked.trials,
        successes=asked.successes,
        difference=asked.difference,
        low=asked.low,
        high=asked.high,
        p=None if asked.counted else asked.p,
        counted=asked.counted,
        open=not asked.decided and not over,
        units=asked.units,
        conclusion=found,
        **_metric(study, asked.means),
    )


def _planned(shared: Sequence[StudyTrialProgress]) -> tuple[int, int]:
    """Return the number of planned cells, and of planned trials of each arm in them."""
    cells = {(trial.trial.goal, trial.trial.start) for trial in shared}
    return len(cells), len({(trial.trial.goal, trial.trial.start, trial.trial.repetition) for trial in shared})


def _whole_plan(
    study: StudyFile, shared: Sequence[StudyTrialProgress], twin: Mapping[tuple[str, int], float]
) -> Primary:
    complete = all(trial.success is not None for trial in shared)
    cells, trials = _planned(shared)
    if isinstance(study.primary, Rate):
        run = _cells(shared, study.primary.arm, lambda trial: trial.success)
        estimate = powered_by_twin(study, run, {(trial.trial.goal, trial.trial.start) for trial in shared}, twin)
        answers = [_against_rate(study, study.primary, shared, estimate, complete=complete)]
        method = f"success rate with its {1 - study.alpha:.0%} interval (Wilson's, at the effective sample size)"
        if study.real_cells is not None:
            method += twin_words(estimate, twin)
        return Primary(method, LIKE_THESE, tuple(answers), cells, trials, "", {})
    pairs = [(first, second) for first, second in arm_pairs(study) if second is not None]
    found = [_compared(study, shared, pair) for pair in pairs]
    adjusted = holm([compared_pair.p for compared_pair in found])
    answers = [
        _of_pair(study, pair, replace(compared_pair, p=p), complete=complete)
        for pair, compared_pair, p in zip(pairs, found, adjusted, strict=True)
    ]
    return Primary(_tested(study), LIKE_THESE, tuple(answers), cells, trials, "", {})


def _tested(study: StudyFile) -> str:
    """Return the name of the test and of the rule that answers the question."""
    metric = "progress" if study.of_progress else "success"
    if study.of_margin:
        tests = "two one-sided sign-flip tests" if study.primary.kind == "equivalence" else "one-sided sign-flip test"
        return (
            f"paired difference of {metric}; {tests} over starting positions against the margin, and the "
            f"{1 - study.alpha:.0%} interval must lie within it; Holm over all pairs"
        )
    return (
        f"paired difference of {metric}; sign-flip test over starting positions, and the interval must exclude "
        f"{'the margin' if study.margin else '0'}; Holm over all pairs"
    )


def _margin_p(study: StudyFile, values: PairedOutcomes) -> float:
    """Return the p-value of equivalence or non-inferiority of a whole plan."""
    found = margin_p(study, values, (values.first.clusters,)) if values.cells else ()
    return found[-1] if found else 1.0


@dataclass(frozen=True, slots=True)
class _Compared:
    """Two arms on their shared cells: outcomes, and the difference in the primary metric."""

    outcomes: PairedOutcomes
    difference: float
    interval: Interval
    p: float
    means: tuple[float, float]


def _compared(study: StudyFile, shared: Sequence[StudyTrialProgress], pair: tuple[str, str]) -> _Compared:
    outcomes = _paired(shared, pair, lambda trial: trial.success)
    values = _paired(shared, pair, lambda trial: trial.progress) if study.of_progress else outcomes
    interval = paired_interval(values, confidence_of(study))
    p = _margin_p(study, values) if study.of_margin else paired_test(values)
    means = [float(arrays(side.cells)[1].mean()) if side.cells else math.nan for side in (values.first, values.second)]
    return _Compared(outcomes, values.difference, interval, p, (means[0], means[1]))


def _metric(study: StudyFile, means: tuple[float, float]) -> dict[str, Any]:
    """Return the fields of an answer about the metric."""
    return {"metric": "progress", "means": means} if study.of_progress else {}


def _of_pair(study: StudyFile, pair: tuple[str, str], seen: _Compared, *, complete: bool) -> PrimaryAnswer:
    first, second = pair
    outcomes, interval = seen.outcomes, seen.interval
    evidence = DifferenceEvidence(seen.difference, interval, seen.p, study.alpha, study.margin, complete)
    found = conclusion_of(study, evidence)
    return PrimaryAnswer(
        first=first,
        second=second,
        cells=len(outcomes.cells),
        trials=outcomes.first.proportion.trials,
        successes=(outcomes.first.proportion.successes, outcomes.second.proportion.successes),
        difference=seen.difference,
        low=interval.low,
        high=interval.high,
        p=seen.p,
        open=not complete,
        conclusion=found,
        **_metric(study, seen.means),
    )


def _against_rate(
    study: StudyFile,
    primary: Rate,
    shared: Sequence[StudyTrialProgress],
    estimate: Powered | None,
    *,
    complete: bool,
) -> PrimaryAnswer:
    cells = _cells(shared, primary.arm, lambda trial: trial.success)
    outcomes = Outcomes(tuple(cells[place] for place in sorted(cells)))
    interval, seen = rate_interval(outcomes, 1 - study.alpha), outcomes.proportion.rate
    if estimate is not None:
        interval, seen = estimate.interval, estimate.rate
    apart = Interval(interval.low - primary.rate, interval.high - primary.rate)
    found = conclude(DifferenceEvidence(seen - primary.rate, apart, None, study.alpha, study.margin, complete))
    return PrimaryAnswer(
        first=primary.arm,
        second=None,
        cells=len(cells),
        trials=outcomes.proportion.trials,
        successes=(outcomes.proportion.successes, 0),
        difference=seen,
        low=interval.low,
        high=interval.high,
        p=None,
        open=not complete,
        conclusion=found,
    )


def _paired(shared: Sequence[StudyTrialProgress], pair: tuple[str, str], value: _Value) -> PairedOutcomes:
    """Pair the cells in which both arms have judged trials with a value."""
    first, second = (_cells(shared, arm, value) for arm in pair)
    return PairedOutcomes(tuple(PairedCell(first[place], second[place]) for place in sorted(first.keys() & second)))


def _cells(shared: Sequence[StudyTrialProgress], arm: str, value: _Value) -> dict[tuple[str, int], Cell]:
    """Return the sum of the values of an arm's judged trials, by goal and starting position."""
    values: dict[tuple[str, int], list[float]] = {}
    for trial in shared:
        if trial.arm == arm and trial.success is not None and (known := value(trial)) is not None:
            values.setdefault((trial.trial.goal, trial.trial.start), []).append(known)
    return {place: Cell(place[1], math.fsum(own), len(own)) for place, own in values.items()}


def in_order(primary: Primary, code: Mapping[str, str]) -> Primary:
    """Return the analysis with pairs, and the arms within them, in the order of the codes."""
    answers = (
        replace(
            answer,
            first=answer.second,
            second=answer.first,
            successes=answer.successes[::-1],
            difference=0.0 - answer.difference,
            low=-answer.high,
            high=-answer.low,
            conclusion=answer.conclusion.reversed,
            means=answer.means[::-1] if answer.means else None,
        )
        if answer.second is not None and code[answer.first] > code[answer.second]
        else answer
        for answer in primary.answers
    )
    ordered = sorted(answers, key=lambda answer: (code[answer.first], code[answer.second] if answer.second else ""))
    dropped = {arm: primary.dropped[arm] for arm in sorted(primary.dropped, key=lambda arm: code[arm])}
    return replace(primary, answers=tuple(ordered), dropped=dropped)
