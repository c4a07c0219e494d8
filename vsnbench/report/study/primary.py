"""Primary analysis of a study and its conclusion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from vsnbench.report.study.progress import ProgressFinding, mean_progress, progress_of_pair, progress_sentence
from vsnbench.report.wording import caution, compared, interval_words, trial_count
from vsnbench.results.studies.entries import StudyTrialProgress
from vsnbench.statistics.clustered import Cell, Outcomes, rate_interval
from vsnbench.statistics.conclusion import Conclusion, Evidence, conclude
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test
from vsnbench.statistics.rates import Interval
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.stopping import Question, decide
from vsnbench.study.units import shared_blocks
from vsnbench.text.sanitize import counted


@dataclass(frozen=True, slots=True)
class Answer:
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
    """Two-sided, adjusted for all pairs. None for a fixed rate in a whole plan, which the interval decides, and for a
    lead that was counted instead of tested."""
    winner: str | None
    """Better arm according to the primary test; for a fixed rate `first` if its rate is above."""
    loser: str | None
    counted: bool = False
    """The remaining trials cannot reverse the lead, and no test was decided."""
    open: bool = False
    """No conclusion is possible yet."""
    units: int = 0
    """Complete units (blocks or starting positions) evaluated by `decided`; 0 for a whole plan."""
    conclusion: Conclusion = Conclusion.NOT_SHOWN
    """Conclusion of `vsnbench.statistics.conclusion`."""
    metric: str = "success"
    """Metric of `difference`, `low` and `high`: success or progress."""
    means: tuple[float, float] | None = None
    """Mean progress of each arm; None for success."""


@dataclass(frozen=True, slots=True)
class Primary:
    """Result of the primary analysis."""

    method: str
    about: str
    """What the inference is about."""
    answers: tuple[Answer, ...]
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


THESE = "these cells only: the starting positions, goals and repetitions of this plan"
LIKE_THESE = "cells like these: a population of which the plan's starting positions and goals are a sample"


def analyse(study: StudyFile, progress: Sequence[StudyTrialProgress]) -> Primary:
    """Carry out the planned analysis on the shared goals."""
    shared = [trial for trial in progress if trial.trial.goal in study.goals]
    if study.stopping == "decided":
        return _decided(study, shared)
    return _whole_plan(study, shared)


def _decided(study: StudyFile, shared: Sequence[StudyTrialProgress]) -> Primary:
    decision = decide(study, shared_blocks(shared, study.goals))
    answers = [_of_question(study, asked, over=bool(decision.over)) for asked in decision.questions]
    replacement = "without" if study.of_these_cells else "with"
    what = (
        "every block" if study.of_these_cells else "every starting position, whose goals and repetitions are one value"
    )
    cells, trials = _planned(shared)
    of = "progress: " if study.of_progress else ""
    return Primary(
        method=f"{of}betting confidence sequence {replacement} replacement, at {what}; Holm over all pairs",
        about=THESE if study.of_these_cells else LIKE_THESE,
        answers=tuple(answers),
        cells=cells,
        trials=trials,
        over=decision.over,
        dropped=decision.dropped,
        unit=decision.unit,
        planned_units=decision.planned_units,
    )


def _of_question(study: StudyFile, asked: Question, *, over: bool) -> Answer:
    """Return the answer to a question of the betting sequences; a lead that was only counted names no winner."""
    rate = study.primary.rate if isinstance(study.primary, Rate) else 0.0
    p = 0.0 if asked.decided and not asked.counted else 1.0  # Holm's decision at an earlier look
    interval = Interval(asked.low - rate, asked.high - rate)
    found = conclude(Evidence(asked.difference - rate, interval, p, study.alpha, study.margin))
    ahead, behind = _sides(asked.first, asked.second, found)
    return Answer(
        first=asked.first,
        second=asked.second,
        cells=asked.cells,
        trials=asked.trials,
        successes=asked.successes,
        difference=asked.difference,
        low=asked.low,
        high=asked.high,
        p=None if asked.counted else asked.p,
        winner=ahead,
        loser=behind,
        counted=asked.counted,
        open=not asked.decided and not over,
        units=asked.units,
        conclusion=found,
        **_metric(study, asked.means),
    )


def _sides(first: str, second: str | None, found: Conclusion) -> tuple[str | None, str | None]:
    """Return the better and the worse arm; for a fixed rate, the arm itself is one of them."""
    if found.sign > 0:
        return first, second
    return (second, first) if found.sign < 0 else (None, None)


def _planned(shared: Sequence[StudyTrialProgress]) -> tuple[int, int]:
    """Return the number of planned cells, and of planned trials of each arm in them."""
    cells = {(trial.trial.goal, trial.trial.start) for trial in shared}
    return len(cells), len({(trial.trial.goal, trial.trial.start, trial.trial.repetition) for trial in shared})


def _whole_plan(study: StudyFile, shared: Sequence[StudyTrialProgress]) -> Primary:
    complete = all(trial.success is not None for trial in shared)
    cells, trials = _planned(shared)
    if isinstance(study.primary, Rate):
        answers = [_against_rate(study, study.primary, shared, complete=complete)]
        method = f"success rate with its {1 - study.alpha:.0%} interval (Wilson's, at the effective sample size)"
        return Primary(method, LIKE_THESE, tuple(answers), cells, trials, "", {})
    pairs = list(combinations(study.arms, 2))
    found = [_compared(study, shared, pair, 1 - study.alpha / len(pairs)) for pair in pairs]
    adjusted = holm([compared_pair.p for compared_pair in found])
    answers = [
        _of_pair(study, pair, replace(compared_pair, p=p), complete=complete)
        for pair, compared_pair, p in zip(pairs, found, adjusted, strict=True)
    ]
    method = (
        f"paired difference of {'progress' if study.of_progress else 'success'}; sign-flip test over starting "
        f"positions, and the interval must exclude {'the margin' if study.margin else '0'}; Holm over all pairs"
    )
    return Primary(method, LIKE_THESE, tuple(answers), cells, trials, "", {})


@dataclass(frozen=True, slots=True)
class _Compared:
    """Two arms on their shared cells: outcomes, and the difference in the primary metric."""

    outcomes: PairedOutcomes
    difference: float
    interval: Interval
    p: float
    means: tuple[float, float]


def _compared(
    study: StudyFile, shared: Sequence[StudyTrialProgress], pair: tuple[str, str], confidence: float
) -> _Compared:
    outcomes = _paired(shared, *pair)
    values = progress_of_pair(shared, pair) if study.of_progress else outcomes
    interval, p = paired_interval(values, confidence), paired_test(values)
    return _Compared(outcomes, values.difference, interval, p, mean_progress(values))


def _metric(study: StudyFile, means: tuple[float, float]) -> dict[str, Any]:
    """Return the fields of an answer about the metric."""
    return {"metric": "progress", "means": means} if study.of_progress else {}


def _of_pair(study: StudyFile, pair: tuple[str, str], seen: _Compared, *, complete: bool) -> Answer:
    first, second = pair
    outcomes, interval = seen.outcomes, seen.interval
    found = conclude(Evidence(seen.difference, interval, seen.p, study.alpha, study.margin, complete))
    ahead, behind = _sides(first, second, found)
    return Answer(
        first=first,
        second=second,
        cells=len(outcomes.cells),
        trials=outcomes.first.proportion.trials,
        successes=(outcomes.first.proportion.successes, outcomes.second.proportion.successes),
        difference=seen.difference,
        low=interval.low,
        high=interval.high,
        p=seen.p,
        winner=ahead,
        loser=behind,
        open=not complete,
        conclusion=found,
        **_metric(study, seen.means),
    )


def _against_rate(study: StudyFile, primary: Rate, shared: Sequence[StudyTrialProgress], *, complete: bool) -> Answer:
    own = [trial for trial in shared if trial.arm == primary.arm and trial.success is not None]
    cells = {(trial.trial.goal, trial.trial.start) for trial in own}
    outcomes = Outcomes(tuple(_cell(own, goal, start) for goal, start in sorted(cells)))
    interval, seen = rate_interval(outcomes, 1 - study.alpha), outcomes.proportion.rate
    apart = Interval(interval.low - primary.rate, interval.high - primary.rate)
    found = conclude(Evidence(seen - primary.rate, apart, None, study.alpha, study.margin, complete))
    ahead, behind = _sides(primary.arm, None, found)
    return Answer(
        first=primary.arm,
        second=None,
        cells=len(cells),
        trials=len(own),
        successes=(outcomes.proportion.successes, 0),
        difference=seen,
        low=interval.low,
        high=interval.high,
        p=None,
        winner=ahead,
        loser=behind,
        open=not complete,
        conclusion=found,
    )


def _paired(shared: Sequence[StudyTrialProgress], first: str, second: str) -> PairedOutcomes:
    """Pair the cells in which every repetition of both arms is judged."""
    sides = [[trial for trial in shared if trial.arm == arm and trial.success is not None] for arm in (first, second)]
    places = [{(trial.trial.goal, trial.trial.start) for trial in side} for side in sides]
    return PairedOutcomes(
        tuple(
            PairedCell(_cell(sides[0], goal, start), _cell(sides[1], goal, start))
            for goal, start in sorted(places[0] & places[1])
        )
    )


def _cell(own: Sequence[StudyTrialProgress], goal: str, start: int) -> Cell:
    results = [bool(trial.success) for trial in own if (trial.trial.goal, trial.trial.start) == (goal, start)]
    return Cell(start, sum(results), len(results))


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


def conclusion(study: StudyFile, primary: Primary, shown: Mapping[str, str], changed_after: int | None) -> str:
    """Return the study's conclusion as one sentence; only the primary test names a better arm.

    Args:
        study: the plan.
        primary: its analysis.
        shown: displayed names of the arms.
        changed_after: number of results when the judging was changed; None if it was not.
    """
    where = "on these cells" if study.of_these_cells else "on the shared goals"
    sentences = [_of(study, answer, shown, where) for answer in primary.answers if not answer.open]
    waiting = sum(answer.open for answer in primary.answers)
    if waiting:
        least = min((answer for answer in primary.answers if answer.open), key=lambda answer: answer.trials)
        done = f"{least.trials} of {trial_count(primary.trials, primary.cells)}"
        if study.by_starting_position:
            done = f"{least.units} of {counted(primary.planned_units, primary.unit)}"
        about = f"about {waiting} of the pairs " if sentences else ""
        both = " by both" if study.primary.kind == "difference" else ""
        sentences.append(f"no conclusion {about}yet: {done} are done{both}")
    words = "; ".join(sentences)
    if changed_after is not None:
        words += f" (the analysis was changed after {changed_after} results)"
    if not any(words.startswith(f"{name} ") for name in shown):  # an arm's name keeps its spelling
        words = words[:1].upper() + words[1:]
    return f"{words}."


def _of(study: StudyFile, answer: Answer, shown: Mapping[str, str], where: str) -> str:
    k, m = answer.successes
    if not answer.cells:
        return f"no data for {' and '.join(shown[arm] for arm in (answer.first, answer.second) if arm)}"
    tried = trial_count(answer.trials, answer.cells)
    if answer.second is None:
        rate = study.primary.rate if isinstance(study.primary, Rate) else 0.5
        text = f"{shown[answer.first]} succeeds in {k} of {tried} [{answer.low:.0%}, {answer.high:.0%}]"
        if answer.winner:
            return f"{text} {where}, better than {rate:.0%}"
        if answer.loser:
            return f"{text} {where}, less than {rate:.0%}"
        return f"{text} {where}: neither above nor below {rate:.0%} was shown"
    if answer.means is not None:
        names = (shown[answer.first], shown[answer.second])
        interval = Interval(answer.low, answer.high)
        finding = ProgressFinding(
            names, answer.means, (k, m), interval, answer.p, answer.conclusion, answer.counted, study.margin
        )
        return progress_sentence(finding, tried, where)
    if answer.winner:
        ahead, behind = (k, m) if answer.winner == answer.first else (m, k)
        better, worse = shown[answer.winner], shown[answer.loser or ""]
        return f"{better} is better than {worse} {where}: {ahead} against {behind} of {tried}"
    named = f"{shown[answer.first]} and {shown[answer.second]}"
    if answer.counted:
        return (
            f"{named} succeeded in {k} and {m} of {tried}; the remaining trials cannot reverse this lead, but no test "
            "showed a difference"
        )
    seen = f"{100 * answer.difference:+.0f} points {interval_words(Interval(answer.low, answer.high))}"
    if doubt := caution(answer.conclusion, study.margin):
        seen += f"; {doubt}" + (f", p {compared(answer.p)}" if answer.p is not None else "")
    return f"no difference was shown between {named} {where} ({seen}); this does not show that they are equal"
