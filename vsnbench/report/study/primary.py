"""The primary analysis of a study, and the one sentence that may be concluded from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from vsnbench.database.study_entries import StudyTrialStanding
from vsnbench.report.verdicts import compared, interval_words
from vsnbench.statistics.clustered import Cell, Outcomes, rate_interval
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval, paired_test
from vsnbench.statistics.rates import Interval
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.stopping import Decision, decide


@dataclass(frozen=True, slots=True)
class Answer:
    """What the primary analysis says of one pair of arms, or of one arm and a rate."""

    first: str
    second: str | None
    """None for a fixed rate."""
    cells: int
    successes: tuple[int, int]
    difference: float
    """Of the rates, first less second; for a fixed rate the first's rate."""
    low: float
    high: float
    p: float | None
    """Two-sided and adjusted for all pairs; None for a fixed rate in a whole plan, where the interval decides."""
    winner: str | None
    """Who is better: the primary test said so. For a fixed rate, `first` where its rate is above it."""
    loser: str | None
    counted: bool = False
    """The lead cannot be taken away any more by what is left, and that is all: no test said anything."""
    open: bool = False
    """Nothing may be concluded yet."""


@dataclass(frozen=True, slots=True)
class Primary:
    """The primary analysis."""

    method: str
    about: str
    """What the inference is about, in words."""
    answers: tuple[Answer, ...]
    cells: int
    """Cells of the shared goals, with repetitions."""
    over: str
    """Why the study is over before every trial is done; empty else."""
    dropped: Mapping[str, int]


THESE = "these cells alone: the starting positions, goals and repetitions of this plan"
LIKE_THESE = "cells like these: starting positions and goals of which the plan's are examples"


def analyse(study: StudyFile, standing: Sequence[StudyTrialStanding]) -> Primary:
    """Carry out the analysis that was named beforehand, on the shared goals.

    Args:
        study: the plan.
        standing: its trials in the order of the schedule.
    """
    shared = [one for one in standing if one.trial.goal in study.goals]
    if study.stopping == "decided":
        return _decided(study, shared)
    return _whole_plan(study, shared)


def _decided(study: StudyFile, shared: Sequence[StudyTrialStanding]) -> Primary:
    blocks: dict[int, dict[str, bool]] = {}
    for one in shared:
        known = blocks.setdefault(one.block, {})
        if one.success is not None:
            known[one.arm] = one.success
    decision: Decision = decide(study, [blocks[block] for block in sorted(blocks)])
    answers = []
    for asked in decision.questions:
        tested = asked.decided and not asked.counted
        loser = None
        if asked.second is not None and asked.winner is not None:
            loser = asked.second if asked.winner == asked.first else asked.first
        answers.append(
            Answer(
                first=asked.first,
                second=asked.second,
                cells=asked.blocks,
                successes=asked.successes,
                difference=asked.difference,
                low=asked.low,
                high=asked.high,
                p=asked.p,
                winner=asked.winner if tested else None,
                loser=loser if tested else (asked.second or ""),
                counted=asked.counted,
                open=not asked.decided and not decision.over,
            )
        )
    replacement = "without" if study.of_these_cells else "with"
    return Primary(
        method=f"betting confidence sequence {replacement} replacement, at every block; Holm over all pairs",
        about=THESE if study.of_these_cells else LIKE_THESE,
        answers=tuple(answers),
        cells=len(blocks),
        over=decision.over,
        dropped=decision.dropped,
    )


def _whole_plan(study: StudyFile, shared: Sequence[StudyTrialStanding]) -> Primary:
    complete = all(one.success is not None for one in shared)
    cells = len({(one.trial.goal, one.trial.start, one.trial.repetition) for one in shared})
    if isinstance(study.primary, Rate):
        answers = [_against_rate(study, study.primary, shared, complete=complete)]
        method = f"success rate with its {1 - study.alpha:.0%} interval (Wilson's, at the effective sample size)"
        return Primary(method, LIKE_THESE, tuple(answers), cells, "", {})
    pairs = list(combinations(study.arms, 2))
    paired = [_paired(shared, first, second) for first, second in pairs]
    adjusted = holm([paired_test(outcomes) for outcomes in paired])
    answers = [
        _of_pair(study, pair, outcomes, p, 1 - study.alpha / len(pairs), complete=complete)
        for pair, outcomes, p in zip(pairs, paired, adjusted, strict=True)
    ]
    method = "paired difference of success; signs of whole starting positions flipped; Holm over all pairs"
    return Primary(method, LIKE_THESE, tuple(answers), cells, "", {})


def _of_pair(
    study: StudyFile, pair: tuple[str, str], outcomes: PairedOutcomes, p: float, confidence: float, *, complete: bool
) -> Answer:
    first, second = pair
    interval = paired_interval(outcomes, confidence)
    difference = outcomes.difference
    beyond = p <= study.alpha and (study.margin == 0 or interval.low > study.margin or interval.high < -study.margin)
    ahead, behind = (first, second) if difference > 0 else (second, first)
    found = complete and beyond
    return Answer(
        first=first,
        second=second,
        cells=len(outcomes.cells),
        successes=(outcomes.first.proportion.successes, outcomes.second.proportion.successes),
        difference=difference,
        low=interval.low,
        high=interval.high,
        p=p,
        winner=ahead if found else None,
        loser=behind if found else None,
        open=not complete,
    )


def _against_rate(study: StudyFile, primary: Rate, shared: Sequence[StudyTrialStanding], *, complete: bool) -> Answer:
    own = [one for one in shared if one.arm == primary.arm and one.success is not None]
    cells = {(one.trial.goal, one.trial.start) for one in own}
    outcomes = Outcomes(tuple(_cell(own, goal, start) for goal, start in sorted(cells)))
    interval = rate_interval(outcomes, 1 - study.alpha)
    above, below = interval.low > primary.rate + study.margin, interval.high < primary.rate - study.margin
    return Answer(
        first=primary.arm,
        second=None,
        cells=len(own),
        successes=(outcomes.proportion.successes, 0),
        difference=outcomes.proportion.rate,
        low=interval.low,
        high=interval.high,
        p=None,
        winner=primary.arm if complete and above else None,
        loser=primary.arm if complete and below else None,
        open=not complete,
    )


def _paired(shared: Sequence[StudyTrialStanding], first: str, second: str) -> PairedOutcomes:
    """Pair the cells in which every repetition of both is judged."""
    sides = [[one for one in shared if one.arm == arm and one.success is not None] for arm in (first, second)]
    places = [{(one.trial.goal, one.trial.start) for one in side} for side in sides]
    return PairedOutcomes(
        tuple(
            PairedCell(_cell(sides[0], goal, start), _cell(sides[1], goal, start))
            for goal, start in sorted(places[0] & places[1])
        )
    )


def _cell(own: Sequence[StudyTrialStanding], goal: str, start: int) -> Cell:
    results = [bool(one.success) for one in own if (one.trial.goal, one.trial.start) == (goal, start)]
    return Cell(start, sum(results), len(results))


def in_order(primary: Primary, code: Mapping[str, str]) -> Primary:
    """Return the analysis with pairs, and the arms within each, in the order of the arms' codes."""
    answers = (
        replace(
            one,
            first=one.second,
            second=one.first,
            successes=one.successes[::-1],
            difference=-one.difference,
            low=-one.high,
            high=-one.low,
        )
        if one.second is not None and code[one.first] > code[one.second]
        else one
        for one in primary.answers
    )
    ordered = sorted(answers, key=lambda one: (code[one.first], code[one.second] if one.second else ""))
    dropped = {arm: primary.dropped[arm] for arm in sorted(primary.dropped, key=lambda arm: code[arm])}
    return replace(primary, answers=tuple(ordered), dropped=dropped)


def conclusion(study: StudyFile, primary: Primary, shown: Mapping[str, str], changed_after: int | None) -> str:
    """Return the study's conclusion, one sentence; it says "better" only of whom the primary test did.

    Args:
        study: the plan.
        primary: its analysis.
        shown: what the arms are called to people now.
        changed_after: results there were when the way of judging was changed; None when it never was.
    """
    where = "on these cells" if study.of_these_cells else "on the shared goals"
    said = [_of(study, one, shown, where) for one in primary.answers if not one.open]
    waiting = sum(one.open for one in primary.answers)
    if waiting:
        least = min(one.cells for one in primary.answers)
        said.append(
            f"no conclusion {'about ' + str(waiting) + ' of the pairs ' if said else ''}yet: "
            f"{least} of {primary.cells} cells are done by both"
            if study.primary.kind == "difference"
            else f"no conclusion yet: {least} of {primary.cells} cells are done"
        )
    words = "; ".join(said)
    if changed_after is not None:
        words += f" (the way of judging was changed after {changed_after} results)"
    return f"{words[:1].upper()}{words[1:]}."


def _of(study: StudyFile, one: Answer, shown: Mapping[str, str], where: str) -> str:
    k, m = one.successes
    if not one.cells:
        return f"nothing is known of {' and '.join(shown[arm] for arm in (one.first, one.second) if arm)}"
    if one.second is None:
        rate = study.primary.rate if isinstance(study.primary, Rate) else 0.5
        told = f"{shown[one.first]} succeeds in {k} of {one.cells} cells [{one.low:.0%}, {one.high:.0%}]"
        if one.winner:
            return f"{told} {where}, better than {rate:.0%}"
        if one.loser and not one.counted and one.loser == one.first:
            return f"{told} {where}, less than {rate:.0%}"
        return f"{told} {where}: neither above nor below {rate:.0%} was shown"
    interval = f"{100 * one.difference:+.0f} points {interval_words(Interval(one.low, one.high))}"
    if one.p is not None and (one.low > 0 or one.high < 0):
        interval += f"; the test decides, p {compared(one.p)}"
    if one.winner:
        ahead, behind = (k, m) if one.winner == one.first else (m, k)
        return (
            f"{shown[one.winner]} is better than {shown[one.loser or '']} {where}: {ahead} against {behind} of "
            f"{one.cells} cells"
        )
    names = f"{shown[one.first]} and {shown[one.second]}"
    if one.counted:
        return (
            f"{names} succeeded in {k} and {m} of {one.cells} cells, counted and no more: what is left cannot turn it, "
            "and no test told them apart"
        )
    return f"between {names} no difference was shown {where} ({interval}), which does not make them equal"
