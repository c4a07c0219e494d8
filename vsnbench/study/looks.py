"""Decisions of a study at planned looks: sign flips of whole starting positions, and repeated confidence intervals.

A look is a number of complete starting positions, counted in the order in which the schedule completes them. At each
look every pair of arms has a p-value (`vsnbench.statistics.sequential.group_sequential`), valid at all looks together,
and an interval at this look's share of alpha divided by the number of pairs. The p-values are compared after Holm at
every look. An answer needs the test and the interval, as for a whole plan (`vsnbench.statistics.conclusion`). A beaten
arm is dropped; its pairs keep their results and still count among the pairs.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from vsnbench.errors import StudyError
from vsnbench.statistics.clustered import Cell, Outcomes, rate_interval
from vsnbench.statistics.conclusion import Conclusion, DifferenceEvidence, conclude, conclude_within
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval
from vsnbench.statistics.rates import Interval
from vsnbench.statistics.sequential.group_sequential import default_looks, look_weights, sequential_p
from vsnbench.study.decision import COMPLETE, DECIDED, HOPELESS, ArmQuestion, StoppingDecision, arm_pairs
from vsnbench.study.file import NonInferiority, Rate, StudyFile
from vsnbench.study.units import START, Block, unit_series


def looks_of(study: StudyFile, starts: int) -> tuple[int, ...]:
    """Return the planned looks of a study; the last is after all starting positions.

    Args:
        study: the plan.
        starts: number of its starting positions.

    Raises:
        StudyError: a look comes after the last starting position.
    """
    if not study.by_looks:
        return (starts,)
    if study.looks is None:
        return default_looks(starts, study.alpha / len(arm_pairs(study)), study.spending)
    if study.looks[-1] > starts:
        raise StudyError(
            f"looks: {study.looks[-1]} is after the last of {starts} starting positions",
            advice=f"end with {starts}, or plan more starting_positions",
            code="look-after-end",
        )
    return study.looks if study.looks[-1] == starts else (*study.looks, starts)


def margin_p(study: StudyFile, outcomes: PairedOutcomes, looks: Sequence[int]) -> tuple[float, ...]:
    """Return the p-value of a pair's question after each look that its outcomes reach.

    Two-sided for a difference beyond the margin; for equivalence the larger of two one-sided ones; one-sided for
    non-inferiority.

    Args:
        study: the plan.
        outcomes: paired cells, whose clusters are numbered in the order of completion.
        looks: all planned looks.
    """
    margin, spending = study.margin, study.spending
    above = _above(tuple(outcomes.cluster_differences(-margin if study.of_margin else margin)), tuple(looks), spending)
    if isinstance(study.primary, NonInferiority):
        return above
    turned = [0.0 - value for value in outcomes.cluster_differences(margin if study.of_margin else -margin)]
    below = _above(tuple(turned), tuple(looks), spending)
    if study.of_margin:
        return tuple(max(pair) for pair in zip(above, below, strict=True))
    return tuple(min(1.0, 2 * min(pair)) for pair in zip(above, below, strict=True))


@lru_cache(maxsize=1024)
def _above(differences: tuple[float, ...], looks: tuple[int, ...], spending: float) -> tuple[float, ...]:
    """Return the p-values of "the mean is at most 0"; cached, because every result asks for the same looks again."""
    return tuple(sequential_p([differences], looks, spending)[0].tolist())


def confidence_of(study: StudyFile, weight: float = 1.0) -> float:
    """Return the confidence of one interval, whatever the question: the intervals of all pairs hold together.

    Args:
        study: the plan.
        weight: share of alpha of the look.
    """
    return 1 - study.alpha * weight / len(arm_pairs(study))


def conclusion_of(study: StudyFile, evidence: DifferenceEvidence) -> Conclusion:
    """Return the conclusion about a pair by the primary analysis of the plan."""
    if study.of_margin:
        return conclude_within(evidence, one_sided=isinstance(study.primary, NonInferiority))
    return conclude(evidence)


ANSWERS = (Conclusion.FIRST_BETTER, Conclusion.SECOND_BETTER, Conclusion.EQUIVALENT, Conclusion.NOT_INFERIOR)
"""Conclusions that decide a question."""


@dataclass(slots=True)
class _Pair:
    """Complete starting positions of one question."""

    first: str
    second: str | None
    starts: tuple[int, ...]
    """Numbers of the starting positions in the order of completion."""
    blocks: tuple[Block, ...]
    """Their blocks."""
    p: tuple[float, ...] = ()
    """p-value after each look that is reached; empty for a fixed rate."""
    decided_at: int | None = None
    """Look of the answer."""
    adjusted: float | None = None
    """p-value after Holm at the newest look."""

    def at(self, look: int) -> tuple[Block, ...]:
        """Return the blocks of the first starting positions."""
        known = set(self.starts[:look])
        return tuple(block for block in self.blocks if block.start in known)

    def side(self, study: StudyFile, arm: str, blocks: Sequence[Block]) -> Outcomes:
        """Return an arm's outcomes by cell; clusters are numbered in the order of completion."""
        order = {start: place for place, start in enumerate(self.starts)}
        values: dict[tuple[int, str], list[float]] = {}
        for block in blocks:
            values.setdefault((order[block.start], block.goal), []).append(float(block.values(study)[arm]))
        return Outcomes(tuple(Cell(place, math.fsum(own), len(own)) for (place, _), own in sorted(values.items())))

    def outcomes(self, study: StudyFile, blocks: Sequence[Block]) -> PairedOutcomes:
        """Return the paired cells of both arms."""
        sides = (self.side(study, arm, blocks).cells for arm in (self.first, self.second or ""))
        return PairedOutcomes(tuple(PairedCell(mine, theirs) for mine, theirs in zip(*sides, strict=True)))


def decide_at_looks(study: StudyFile, blocks: Sequence[Block]) -> StoppingDecision:
    """Return the decisions that the results so far support.

    Args:
        study: the plan.
        blocks: all planned blocks of the shared goals in the order of the schedule, with the available results.
    """
    planned = len({block.start for block in blocks})
    looks = looks_of(study, planned)
    weights = dict(zip(looks, look_weights(looks, study.spending), strict=True))
    pairs = [_pair(study, blocks, looks, *pair) for pair in arm_pairs(study)]
    dropped: dict[str, int] = {}
    for number, look in enumerate(looks):
        if not any(len(pair.starts) >= look for pair in pairs):
            break
        adjusted = holm([pair.p[min(number, len(pair.p) - 1)] if pair.p else 1.0 for pair in pairs])
        for pair, p in zip(pairs, adjusted, strict=True):
            if pair.decided_at is not None or not pair.starts:
                continue
            pair.adjusted = p if pair.second is not None else None
            reached = max((known for known in looks[: number + 1] if known <= len(pair.starts)), default=0)
            if reached and (found := _concluded(study, pair, reached, weights[reached])[0]) in ANSWERS:
                pair.decided_at = look
                if pair.second is not None and found.sign:
                    dropped.setdefault(pair.second if found.sign > 0 else pair.first, look)
    questions = tuple(_question(study, pair, weights) for pair in pairs)
    over = _over(study, pairs, dropped, looks)
    return StoppingDecision(questions, dropped, over, START, planned, looks)


def _pair(study: StudyFile, blocks: Sequence[Block], looks: tuple[int, ...], first: str, second: str | None) -> _Pair:
    known = unit_series(study, blocks, first, second).blocks
    pair = _Pair(first, second, tuple(dict.fromkeys(block.start for block in known)), known)
    if second is not None:
        pair.p = margin_p(study, pair.outcomes(study, known), looks)
    return pair


def _concluded(study: StudyFile, pair: _Pair, look: int, weight: float) -> tuple[Conclusion, float, Interval]:
    """Return the conclusion, the estimate and the interval of a pair at a look."""
    blocks = pair.at(look)
    confidence = confidence_of(study, weight)
    if pair.second is None:
        reference = study.primary.rate if isinstance(study.primary, Rate) else 0.5
        side = pair.side(study, pair.first, blocks)
        seen, interval = side.proportion.rate, rate_interval(side, confidence)
        apart = Interval(interval.low - reference, interval.high - reference)
        found = conclude(DifferenceEvidence(seen - reference, apart, None, study.alpha, study.margin))
        return found, seen, interval
    outcomes = pair.outcomes(study, blocks)
    interval = paired_interval(outcomes, confidence)
    p = 1.0 if pair.adjusted is None else pair.adjusted
    evidence = DifferenceEvidence(outcomes.difference, interval, p, study.alpha, study.margin)
    return conclusion_of(study, evidence), outcomes.difference, interval


def _question(study: StudyFile, pair: _Pair, weights: Mapping[int, float]) -> ArmQuestion:
    newest = pair.decided_at or max(weights)
    look = max((known for known in weights if known <= min(newest, len(pair.starts))), default=0)
    blocks = pair.at(look)
    found, seen, interval = _concluded(study, pair, look, weights[look]) if look else (None, math.nan, _NOTHING)
    means = [
        math.fsum(block.values(study)[arm] for block in blocks) / len(blocks) if blocks else math.nan
        for arm in (pair.first, pair.second)
        if arm is not None
    ]
    return ArmQuestion(
        first=pair.first,
        second=pair.second,
        units=look,
        trials=len(blocks),
        cells=len({(block.goal, block.start) for block in blocks}),
        successes=(
            sum(block.succeeded[pair.first] for block in blocks),
            sum(block.succeeded[pair.second] for block in blocks) if pair.second is not None else 0,
        ),
        means=(means[0], means[1] if pair.second is not None else 0.0),
        difference=seen,
        low=interval.low,
        high=interval.high,
        p=pair.adjusted if look and pair.second is not None else None if pair.second is None else 1.0,
        winner=None if found is None else {1: pair.first, -1: pair.second}.get(found.sign),
        decided=pair.decided_at is not None,
        decided_at=pair.decided_at,
        counted=False,
        conclusion=found,
    )


_NOTHING = Interval(math.nan, math.nan)


def _over(study: StudyFile, pairs: Sequence[_Pair], dropped: Mapping[str, int], looks: tuple[int, ...]) -> str:
    """Return why the study is over, or an empty string."""
    still = [
        pair for pair in pairs if pair.decided_at is None and pair.first not in dropped and pair.second not in dropped
    ]
    if not still:
        return DECIDED
    if all(len(pair.starts) >= looks[-1] for pair in still):
        return COMPLETE
    return HOPELESS if all(_hopeless(study, pair, looks) for pair in still) else ""


def _hopeless(study: StudyFile, pair: _Pair, looks: tuple[int, ...]) -> bool:
    """Whether neither arm could be found better even if all remaining positions favoured it; checked at looks only."""
    if pair.second is None or study.of_margin or len(pair.starts) not in looks:
        return False
    left = looks[-1] - len(pair.starts)
    cells = len(pair.outcomes(study, pair.blocks).cells) / len(pair.starts)
    ends = []
    for sign in (1, -1):
        known = pair.outcomes(study, pair.blocks).cluster_differences(sign * study.margin)
        rest = [cells * (1 - study.margin)] * left
        ends.append(_above((*(sign * value for value in known), *rest), looks, study.spending)[-1])
    return 2 * min(ends) > study.alpha  # Holm's mildest threshold


def earliest_decision(study: StudyFile, blocks: Sequence[Block]) -> int | None:
    """Return the first look at which an outcome can decide a question; None if none can.

    The outcomes assumed are the clearest: one arm succeeds in every trial and all others fail, or all succeed if the
    question is whether they are equally good.

    Args:
        study: the plan.
        blocks: all planned blocks of the shared goals; results are ignored.
    """
    first = arm_pairs(study)[0][0]
    equal = study.primary.kind == "equivalence"
    for good in (True, False):
        results = {arm: good if equal else (arm == first) is good for arm in study.arms}
        shares = {arm: float(success) for arm, success in results.items()}
        clear = [Block(block.goal, block.start, results, shares) for block in blocks]
        decided = [found.decided_at for found in decide_at_looks(study, clear).questions if found.decided_at]
        if decided:
            return min(decided)
    return None
