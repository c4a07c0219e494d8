"""Sequential decisions of a study: results of each pair, dropped arms, and when to stop.

Sign flips at planned looks are in `vsnbench.study.looks`. For bets, each pair of arms (or an arm and its rate) has an
anytime-valid p-value (`vsnbench.statistics.sequential.betting`) from the independent units of the study
(`vsnbench.study.units`). At every look the p-values are compared after Holm (1979): the smallest with alpha over the
number of pairs, the next with alpha over one less, and so on. This controls the family-wise error over all looks: the
probability that any of the k true hypotheses ever falls to alpha/k is at most alpha, and otherwise Holm rejects no true
hypothesis at any look (Bartroff and Song 2014). A beaten arm is dropped; its pairs keep their results and still count
among the pairs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsnbench.statistics.sequential.betting import as_share, p_values, sequence
from vsnbench.study.decision import COMPLETE, DECIDED, HOPELESS, ArmQuestion, StoppingDecision, arm_pairs
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.looks import decide_at_looks, earliest_decision
from vsnbench.study.units import Block, UnitRule, UnitSeries, unit_rule, unit_series


@dataclass(slots=True)
class _SequentialTest:
    """One-sided p-values of a question after each unit."""

    first: str
    second: str | None
    series: UnitSeries
    above: list[float]
    below: list[float]

    @property
    def units(self) -> int:
        return len(self.above)

    def p_at(self, units: int) -> float:
        known = min(units, self.units)
        return two_sided(self.above[known - 1], self.below[known - 1]) if known else 1.0


def two_sided(above: float, below: float) -> float:
    """Return the two-sided p-value of two one-sided ones."""
    return min(1.0, 2 * min(above, below))


def decide(study: StudyFile, blocks: Sequence[Block]) -> StoppingDecision:
    """Return the decisions that the results so far support.

    Args:
        study: the plan.
        blocks: all planned blocks of the shared goals in the order of the schedule, with the available results.
    """
    if study.by_looks:
        return decide_at_looks(study, blocks)
    rule = unit_rule(study, blocks)
    tests = [_sequential_test(study, pair, blocks, rule) for pair in arm_pairs(study)]
    longest = max((test.units for test in tests), default=0)
    dropped: dict[str, int] = {}
    found: dict[int, tuple[str | None, int]] = {}
    for looked in range(1, longest + 1):
        for place in _rejected([test.p_at(looked) for test in tests], study.alpha):
            if place not in found:
                winner, loser = _winner_and_loser(tests[place], looked)
                found[place] = winner, looked
                if loser is not None:
                    dropped.setdefault(loser, looked)
    questions = tuple(
        _question(study, test, rule, found.get(place, (None, None)), decided=place in found)
        for place, test in enumerate(tests)
    )
    over = _stop_reason(study, tests, questions, dropped, rule)
    return StoppingDecision(questions, dropped, over, rule.name, rule.planned)


def min_units(study: StudyFile, blocks: Sequence[Block]) -> int | None:
    """Return the smallest number of units for a decision; None if no outcome leads to one.

    This assumes that one arm wins every block, or that all trials against a fixed rate succeed or all fail.

    Args:
        study: the plan.
        blocks: all planned blocks of the shared goals; results are ignored.
    """
    if study.by_looks:
        return earliest_decision(study, blocks)
    rule = unit_rule(study, blocks)
    _, second = arm_pairs(study)[0]
    low, high = _bounds(study, second)
    above, _ = p_values(np.ones(rule.planned), high, rule.size, rule.fractions)
    _, below = p_values(np.zeros(rule.planned), low, rule.size, rule.fractions)
    level = study.alpha / len(arm_pairs(study))
    enough = np.flatnonzero((2 * np.minimum(above, below) <= level) & (np.minimum(above, below) > 0))
    return int(enough[0]) + 1 if len(enough) else None


def _sequential_test(
    study: StudyFile, pair: tuple[str, str | None], blocks: Sequence[Block], rule: UnitRule
) -> _SequentialTest:
    first, second = pair
    series = unit_series(study, blocks, first, second)
    low, high = _bounds(study, second)
    above, _ = p_values(series.values, high, rule.size, rule.fractions)
    _, below = p_values(series.values, low, rule.size, rule.fractions)
    return _SequentialTest(first, second, series, above.tolist(), below.tolist())


def _bounds(study: StudyFile, second: str | None) -> tuple[float, float]:
    """Return the interval of means in which neither is better, mapped to 0 to 1."""
    if second is not None:
        return float(as_share(-study.margin)), float(as_share(study.margin))
    rate = study.primary.rate if isinstance(study.primary, Rate) else 0.5
    return max(0.0, rate - study.margin), min(1.0, rate + study.margin)


def _rejected(p: Sequence[float], alpha: float) -> list[int]:
    """Return the indices of the hypotheses that Holm rejects."""
    rejected: list[int] = []
    for rank, place in enumerate(sorted(range(len(p)), key=lambda index: p[index])):
        if p[place] > alpha / (len(p) - rank):
            break
        rejected.append(place)
    return rejected


def _winner_and_loser(test: _SequentialTest, blocks: int) -> tuple[str | None, str | None]:
    known = min(blocks, len(test.above)) - 1
    better = test.above[known] <= test.below[known]
    if test.second is None:
        return (test.first if better else None), None
    return (test.first, test.second) if better else (test.second, test.first)


def _question(
    study: StudyFile, test: _SequentialTest, rule: UnitRule, found: tuple[str | None, int | None], *, decided: bool
) -> ArmQuestion:
    series, pair = test.series, (test.first, test.second)
    mine = sum(block.succeeded[test.first] for block in series.blocks)
    theirs = sum(block.succeeded[test.second] for block in series.blocks) if test.second else 0
    means = tuple(_mean([block.values(study)[arm] for block in series.blocks]) if arm else 0.0 for arm in pair)
    difference, low, high = float("nan"), 0.0, 1.0
    if series.values:
        steps = None if study.of_progress else 2 if test.second else 1
        lows, highs = sequence(series.values, rule.size, study.alpha, steps, rule.fractions)
        difference, low, high = float(np.mean(series.values)), float(lows[-1]), float(highs[-1])
    if test.second:
        difference, low, high = 2 * difference - 1, 2 * low - 1, 2 * high - 1
    return ArmQuestion(
        first=test.first,
        second=test.second,
        units=test.units,
        trials=len(series.blocks),
        cells=len({(block.goal, block.start) for block in series.blocks}),
        successes=(mine, theirs),
        means=(means[0], means[1]),
        difference=difference,
        low=low,
        high=high,
        p=test.p_at(test.units),
        winner=found[0],
        decided=decided,
        decided_at=found[1],
        counted=found[1] is not None and test.p_at(found[1]) == 0,
    )


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else float("nan")


def _stop_reason(
    study: StudyFile,
    tests: Sequence[_SequentialTest],
    questions: Sequence[ArmQuestion],
    dropped: Mapping[str, int],
    rule: UnitRule,
) -> str:
    still = [
        test
        for test, question in zip(tests, questions, strict=True)
        if not question.decided and question.first not in dropped and question.second not in dropped
    ]
    if not still:
        return DECIDED
    if all(test.units == rule.planned for test in still):
        return COMPLETE
    # Alpha is Holm's mildest threshold: what cannot fall to it whatever comes can never be decided.
    if all(_undecidable(study, test, rule) for test in still):
        return HOPELESS
    return ""


def _undecidable(study: StudyFile, test: _SequentialTest, rule: UnitRule) -> bool:
    """Whether neither side could be found better even if all remaining units favoured it."""
    left, values = rule.planned - test.units, test.series.values
    low, high = _bounds(study, test.second)
    above, _ = p_values(np.concatenate((values, np.ones(left))), high, rule.size, rule.fractions)
    _, below = p_values(np.concatenate((values, np.zeros(left))), low, rule.size, rule.fractions)
    return bool(2 * min(above[-1], below[-1]) > study.alpha)
