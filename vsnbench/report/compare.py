"""Compares two conditions honestly: one question, one p-value, and test, interval and difference on the same episodes.

Cells (goal x starting position) that both were tried in, in the same site, are paired; the test flips the sign of whole
starting positions, however many goals, seeds and repetitions they hold. Else the samples are independent, and whole
starting positions are exchanged. No winner is named while trials are missing: the missing ones may be the hard ones.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from vsnbench.errors import UsageError
from vsnbench.harmless_text import harmless
from vsnbench.report.conditions import Condition
from vsnbench.report.effects import MEASURED, EffectComparison, effects
from vsnbench.report.outlook import Outlook, Reach, outlook_of, reach_of
from vsnbench.report.pairing import Matches, Pairing, match, pair, same_places, seeded
from vsnbench.report.peers import ENOUGH_COVERAGE
from vsnbench.report.record import Record, empty_record, goal_order
from vsnbench.report.summary import ConditionSummary, Results, Summary
from vsnbench.statistics.clustered import Outcomes, independent_difference
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.paired import paired_interval, paired_test
from vsnbench.statistics.permutation import exchange_clusters, fisher_effective, stratified_permutation
from vsnbench.statistics.rates import CONFIDENCE, Interval, Proportion, barnard, fisher, mcnemar_exact

if TYPE_CHECKING:
    import pandas as pd

ALL, SHARED = "all goals", "shared goals"

FLIPPED = "starting positions' signs flipped"
MCNEMAR = "McNemar, exact"
EXCHANGED = "starting positions exchanged"
FISHER = "Fisher, exact"
EFFECTIVE = "Fisher, exact, at the effective sample sizes"


@dataclass(frozen=True, slots=True)
class OtherTests:
    """P-values that are not read, for whoever asks: they take episodes for independent. NaN where they do not fit."""

    fisher_p: float
    barnard_p: float
    """NaN where there are too many trials for it."""
    mcnemar_p: float
    """Of the pairs with one seed and repetition."""
    permutation_p: float
    """Of permuting the models within each starting position."""


@dataclass(frozen=True, slots=True)
class RateComparison:
    """Two success rates on one set of goals."""

    scope: str
    """`all goals`, `shared goals`, or a goal."""
    goals: tuple[tuple[str, ...], tuple[str, ...]]
    """Of the first and of the second; the same but for `all goals`."""
    first: Summary
    """Of all its episodes on these goals, compared or left out."""
    second: Summary
    pairing: Pairing | None
    """None where the samples are independent."""
    matches: Matches | None
    """Of the paired episodes; None where the samples are independent."""
    test: str
    """The one that is read, by name; chosen by the design, not by its answer."""
    p: float
    """Its two-sided p-value, before any correction."""
    adjusted_p: float = math.nan
    """`p` after Holm over everything asked together."""
    outlook: Outlook | None = None
    """What this design could show; None where a difference was found, or nothing can be said."""

    @property
    def compared(self) -> tuple[Proportion, Proportion]:
        """Successes of the episodes that test, interval and difference are about."""
        return self.pairing.proportions if self.pairing else (self.first.proportion, self.second.proportion)

    @property
    def others(self) -> OtherTests:
        """The tests that are not read; worked out when asked for: tens of thousands of trials take them a second."""
        a, b, matches = self.first.proportion, self.second.proportion, self.matches
        return OtherTests(
            fisher_p=fisher(a, b),
            barnard_p=barnard(a, b),
            mcnemar_p=mcnemar_exact(matches.only_first, matches.only_second) if matches and matches.pairs else math.nan,
            permutation_p=stratified_permutation(self.pairing.strata()) if self.pairing else math.nan,
        )

    @property
    def difference(self) -> float:
        """First success rate less the second, as shares; of paired ones the mean over the cells."""
        return self.pairing.outcomes.difference if self.pairing else self.first.success_rate - self.second.success_rate

    @property
    def interval(self) -> Interval:
        """95 % interval of the difference: Newcombe's, paired where the test is, by starting position."""
        if self.pairing:
            return paired_interval(self.pairing.outcomes)
        return independent_difference(self.first.outcomes, self.second.outcomes)

    @property
    def reach(self) -> Reach:
        """How small a p-value these numbers of starting positions, or of trials, can give at all."""
        return reach_of(self.pairing, self.first.outcomes, self.second.outcomes, by_start=self.test == EXCHANGED)

    @property
    def covered(self) -> bool:
        """Whether enough of the planned trials of both are done to name a winner."""
        return min(self.first.coverage, self.second.coverage) >= ENOUGH_COVERAGE

    @property
    def significant(self) -> bool:
        """Whether the difference is beyond chance, corrected for everything asked together, and its interval agrees."""
        return self.below_level and not self.doubted

    @property
    def below_level(self) -> bool:
        """Whether the corrected p-value is small enough."""
        return self.adjusted_p < 1 - CONFIDENCE

    @property
    def doubted(self) -> bool:
        """Whether the interval holds 0.

        It can while p is small: positions that happen to be more alike than chance would have them make the test sharp,
        and the interval never takes episodes for worth more than as many independent ones.
        """
        return 0.0 in self.interval

    @property
    def cells(self) -> tuple[int, int]:
        """Cells that the compared episodes of each come from."""
        if self.pairing:
            return len(self.pairing.outcomes.cells), len(self.pairing.outcomes.cells)
        return len(self.first.outcomes.cells), len(self.second.outcomes.cells)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Everything about one pair of conditions."""

    first: Condition
    second: Condition
    rates: tuple[RateComparison, ...]
    effects: tuple[EffectComparison, ...]
    asked: int
    """How many p-values the Holm correction is over."""

    @property
    def level(self) -> float:
        """Below which a p-value surely counts: 0.05 divided by the questions asked together."""
        return (1 - CONFIDENCE) / max(1, self.asked)


def compare(
    record: Record,
    results: Results,
    names: Sequence[str],
    *,
    by_goal: bool = False,
    published: Results | None = None,
    outlooks: bool = True,
) -> tuple[Comparison, ...]:
    """Compare every pair of the named conditions.

    Args:
        record: the episodes.
        results: their summaries.
        names: models, or conditions as reports name them; `paper:vlv` is the paper's.
        by_goal: each shared goal by itself as well.
        published: the paper's results.
        outlooks: say what designs that found nothing could have found, which takes a second or two a pair.

    Raises:
        UsageError: a name fits no condition or several, or there are fewer than two.
    """
    if len(names) < 2:
        raise UsageError("name at least two models to compare")
    found = [find_condition(name, results, published) for name in names]
    if len({one.condition.number for one in found}) < len(found):
        raise UsageError("a comparison needs different models: one is named twice")
    sides = [_side(record, one) for one in found]
    raw = [_pair(a, b, by_goal=by_goal) for a, b in itertools.combinations(sides, 2)]
    # The totals over all goals restate the shared ones: the family is what is asked, on the goals that can be compared.
    family = [rate.p for one in raw for rate in one.rates if rate.scope != ALL]
    adjusted = iter(holm(family))
    finished = []
    for pair_of in raw:
        corrected = (
            replace(rate, adjusted_p=rate.p if rate.scope == ALL else next(adjusted)) for rate in pair_of.rates
        )
        one = replace(pair_of, rates=tuple(corrected), asked=len(family))
        rates = tuple(
            replace(rate, outlook=_outlook(rate, one.level))
            if outlooks and rate.scope in (ALL, SHARED) and rate.covered and not rate.significant
            else rate
            for rate in one.rates
        )
        finished.append(replace(one, rates=rates))
    return tuple(finished)


def _outlook(rate: RateComparison, level: float) -> Outlook | None:
    return outlook_of(rate.pairing, rate.first, rate.second, level, by_start=rate.test == EXCHANGED)


def find_condition(name: str, results: Results, published: Results | None) -> ConditionSummary:
    """Return the condition that a user means.

    Raises:
        UsageError: none, or more than one; the message lists them.
    """
    if name.startswith("paper:"):
        for one in published.conditions if published else ():
            if one.condition.model == name.removeprefix("paper:").lower():
                return one
        raise UsageError(f"the paper has no model {name.removeprefix('paper:')!r}: it has paper:vlv and paper:pirlnav")
    exact = [one for one in results.conditions if one.condition.name == name]
    fitting = exact or [one for one in results.conditions if one.condition.model == name]
    if len(fitting) == 1:
        return fitting[0]
    known = ", ".join(repr(harmless(one.condition.name)) for one in fitting or results.conditions)
    if fitting:
        raise UsageError(f"{harmless(name)!r} was tested under several conditions, name one of them: {known}")
    raise UsageError(
        f"no results of {harmless(name)!r}: there are {known}; paper:vlv and paper:pirlnav are the paper's"
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One condition, and what its comparisons with all the others need of its episodes that count, taken out once."""

    summary: ConditionSummary
    rows: "pd.DataFrame"
    seeded: "pd.DataFrame"


def _side(record: Record, one: ConditionSummary) -> _Side:
    if one.condition.published:
        record = empty_record()  # whose numbers are no condition's of the record
    rows = record.counted(one.condition)[["goal", "start", "campaign", "repetition", "success", *MEASURED]]
    return _Side(one, rows, seeded(rows, one.condition))


def _pair(one: _Side, other: _Side, *, by_goal: bool) -> Comparison:
    first, second = one.summary, other.summary
    mine, theirs = (tuple(goal.goal for goal in each.goals) for each in (first, second))
    shared = tuple(sorted(set(mine) & set(theirs), key=goal_order))
    scopes: list[tuple[str, tuple[str, ...], tuple[str, ...]]] = [(SHARED, shared, shared)] if shared else []
    if set(mine) != set(theirs):
        scopes.insert(0, (ALL, mine, theirs))
    if by_goal and len(shared) > 1:
        scopes += [(goal, (goal,), (goal,)) for goal in shared]
    rates = tuple(_rate(scope, (one, own), (other, others)) for scope, own, others in scopes)
    measured: tuple[EffectComparison, ...] = ()
    if shared and not (first.condition.published or second.condition.published):
        together = same_places(first.condition, second.condition)
        measured = effects(one.rows, other.rows, shared, together=together)
    return Comparison(first.condition, second.condition, rates, measured, 0)


def _rate(scope: str, one: tuple[_Side, tuple[str, ...]], other: tuple[_Side, tuple[str, ...]]) -> RateComparison:
    first, second = (one[0].summary, one[1]), (other[0].summary, other[1])
    a, b = over_goals(*first), over_goals(*second)
    pairing = None if scope == ALL else pair(first[0], second[0], first[1])
    matches = match(one[0].seeded, other[0].seeded, first[1]) if pairing else None
    if pairing:
        test, p = MCNEMAR if pairing.single else FLIPPED, paired_test(pairing.outcomes)
    elif a.outcomes.independent and b.outcomes.independent:
        test, p = FISHER, fisher(a.proportion, b.proportion)
    elif _placed(a.outcomes, first[0]) and _placed(b.outcomes, second[0]):
        test, p = EXCHANGED, exchange_clusters(a.outcomes, b.outcomes)
    else:
        test, p = EFFECTIVE, fisher_effective(a.outcomes, b.outcomes)
    return RateComparison(scope, (first[1], second[1]), a, b, pairing, matches, test, p)


def _placed(outcomes: Outcomes, one: ConditionSummary) -> bool:
    """Whether it is known which episodes share a starting position."""
    return not one.condition.published and all(cell.cluster > 0 for cell in outcomes.cells)


def over_goals(one: ConditionSummary, goals: Sequence[str]) -> Summary:
    """Sum up some goals; only what rates need."""
    chosen = [goal.summary for goal in one.goals if goal.goal in goals]
    return replace(
        chosen[0],
        successes=sum(each.successes for each in chosen),
        episodes=sum(each.episodes for each in chosen),
        planned=sum(each.planned for each in chosen),
        outcomes=Outcomes(tuple(cell for each in chosen for cell in each.outcomes.cells)),
    )
