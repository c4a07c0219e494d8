"""When a study is decided: the question of each pair after every block, who is beaten, and whether more could tell.

Each pair of arms (or one arm and its fixed rate) has an anytime-valid p-value (`vsnbench.statistics.betting`). They are
read together after Holm (1979): at every look, the smallest against alpha over the number of pairs, the next against
alpha over one less, and so on. That keeps the family-wise error at every look and all of them together: the event that
some true hypothesis among the k that are true ever falls to alpha/k has a chance of at most alpha, and outside of it
Holm rejects no true one, at no look (Bartroff and Song 2014). An arm that is beaten is run no more; what its pairs
have shown until then stands, and they still count among the pairs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vsnbench.statistics.betting import as_share, p_values, sequence
from vsnbench.study.file import Rate, StudyFile

Outcomes = Mapping[str, bool]
"""Of one block: arm -> whether it succeeded, for the arms whose result is there."""


@dataclass(frozen=True, slots=True)
class Question:
    """One pair of arms, or one arm and a rate, and what is known of it."""

    first: str
    second: str | None
    """None for a fixed rate."""
    blocks: int
    """Blocks it rests on: the scheduled ones up to the first that is not complete."""
    successes: tuple[int, int]
    """In these blocks; the second is 0 for a fixed rate."""
    difference: float
    """Of the rates, first less second, or the first's rate; NaN before the first block."""
    low: float
    high: float
    """The confidence sequence, 1 - alpha for this question alone."""
    p: float
    """Two-sided, valid at every look."""
    winner: str | None
    """Who is better, after Holm over all questions; for a fixed rate the arm itself where its rate is above."""
    decided: bool
    decided_at: int | None
    """After how many blocks."""

    counted: bool
    """It was no inference that decided: what was left of the plan could not take the lead away any more. No evidence
    beyond these cells."""


@dataclass(frozen=True, slots=True)
class Decision:
    """Where a study with `stopping: decided` stands."""

    questions: tuple[Question, ...]
    dropped: Mapping[str, int]
    """Arm that is beaten -> after how many blocks."""
    over: str
    """Why nothing more need be run; empty while something does."""

    @property
    def standing(self) -> frozenset[str]:
        """Arms that nobody has beaten, of those that are asked about."""
        asked = {name for one in self.questions for name in (one.first, one.second) if name}
        return frozenset(asked - set(self.dropped))


@dataclass(slots=True)
class _Course:
    """The two one-sided p-values of a question, block by block."""

    first: str
    second: str | None
    shares: list[float]
    above: list[float]
    below: list[float]

    def p_at(self, blocks: int) -> float:
        known = min(blocks, len(self.above))
        return min(1.0, 2 * min(self.above[known - 1], self.below[known - 1])) if known else 1.0


def decide(study: StudyFile, blocks: Sequence[Outcomes]) -> Decision:
    """Say what the blocks so far decide.

    Args:
        study: the plan.
        blocks: every planned block of the shared goals, in the order of the schedule, with the results that are there.
    """
    size = len(blocks) if study.of_these_cells else None
    courses = [_course(study, pair, blocks, size) for pair in _asked(study)]
    longest = max((len(course.shares) for course in courses), default=0)
    dropped: dict[str, int] = {}
    found: dict[int, tuple[str | None, int]] = {}
    for looked in range(1, longest + 1):
        for place in _rejected([course.p_at(looked) for course in courses], study.alpha):
            if place not in found:
                winner, loser = _who(courses[place], looked)
                found[place] = winner, looked
                if loser is not None:
                    dropped.setdefault(loser, looked)
    questions = tuple(
        _question(study, course, blocks, size, found.get(place, (None, None)), decided=place in found)
        for place, course in enumerate(courses)
    )
    return Decision(questions, dropped, _why_over(study, courses, questions, dropped, len(blocks), size))


def _asked(study: StudyFile) -> list[tuple[str, str | None]]:
    if isinstance(study.primary, Rate):
        return [(study.primary.arm, None)]
    return [(first, second) for first, second in combinations(study.arms, 2)]


def _course(study: StudyFile, pair: tuple[str, str | None], blocks: Sequence[Outcomes], size: int | None) -> _Course:
    first, second = pair
    shares: list[float] = []
    for outcomes in blocks:
        if first not in outcomes or (second is not None and second not in outcomes):
            break  # what comes after would be looked at in an order that is not the random one
        shares.append(_share(outcomes, first, second))
    low, high = _bounds(study, second)
    above, _ = p_values(shares, high, size)
    _, below = p_values(shares, low, size)
    return _Course(first, second, shares, above.tolist(), below.tolist())


def _share(outcomes: Outcomes, first: str, second: str | None) -> float:
    if second is None:
        return float(outcomes[first])
    return float(as_share(float(outcomes[first]) - float(outcomes[second])))


def _bounds(study: StudyFile, second: str | None) -> tuple[float, float]:
    """Return the means between which nobody is better, as shares."""
    if second is not None:
        return float(as_share(-study.margin)), float(as_share(study.margin))
    rate = study.primary.rate if isinstance(study.primary, Rate) else 0.5
    return max(0.0, rate - study.margin), min(1.0, rate + study.margin)


def _rejected(p: Sequence[float], alpha: float) -> list[int]:
    """Return the places of the hypotheses that Holm rejects."""
    rejected: list[int] = []
    for rank, place in enumerate(sorted(range(len(p)), key=lambda one: p[one])):
        if p[place] > alpha / (len(p) - rank):
            break
        rejected.append(place)
    return rejected


def _who(course: _Course, blocks: int) -> tuple[str | None, str | None]:
    known = min(blocks, len(course.above)) - 1
    better = course.above[known] <= course.below[known]
    if course.second is None:
        return (course.first if better else None), None
    return (course.first, course.second) if better else (course.second, course.first)


def _question(
    study: StudyFile,
    course: _Course,
    blocks: Sequence[Outcomes],
    size: int | None,
    found: tuple[str | None, int | None],
    *,
    decided: bool,
) -> Question:
    count = len(course.shares)
    seen = blocks[:count]
    mine = sum(outcomes[course.first] for outcomes in seen)
    theirs = sum(outcomes[course.second] for outcomes in seen) if course.second else 0
    low, high = 0.0, 1.0
    if count:
        lows, highs = sequence(course.shares, size, study.alpha, 2 if course.second else 1)
        low, high = float(lows[-1]), float(highs[-1])
    if course.second:
        low, high = 2 * low - 1, 2 * high - 1
    return Question(
        first=course.first,
        second=course.second,
        blocks=count,
        successes=(mine, theirs),
        difference=(mine - theirs) / count if count else float("nan"),
        low=low,
        high=high,
        p=course.p_at(count),
        winner=found[0],
        decided=decided,
        decided_at=found[1],
        counted=found[1] is not None and course.p_at(found[1]) == 0,
    )


def _why_over(
    study: StudyFile,
    courses: Sequence[_Course],
    questions: Sequence[Question],
    dropped: Mapping[str, int],
    planned: int,
    size: int | None,
) -> str:
    still = [
        course
        for course, one in zip(courses, questions, strict=True)
        if not one.decided and one.first not in dropped and one.second not in dropped
    ]
    if not still:
        return "the primary analysis is decided"
    if all(len(course.shares) == planned for course in still):
        return "every block is run"
    # Alpha is Holm's mildest threshold: what cannot fall to it whatever comes can never be decided.
    if all(_hopeless(study, course, planned, size) for course in still):
        return "what is left could not change the answer"
    return ""


def _hopeless(study: StudyFile, course: _Course, planned: int, size: int | None) -> bool:
    """Whether neither side would be found better if every block to come spoke for it."""
    left = planned - len(course.shares)
    low, high = _bounds(study, course.second)
    above, _ = p_values(np.concatenate((course.shares, np.ones(left))), high, size)
    _, below = p_values(np.concatenate((course.shares, np.zeros(left))), low, size)
    return bool(2 * min(above[-1], below[-1]) > study.alpha)
