"""Compares two conditions with one test, interval and difference over the same episodes.

Cells (goal x starting position) that both conditions share in the same site are paired, and the test flips the signs of
whole starting positions. Otherwise the samples are independent, and whole starting positions are exchanged. No winner
is named while trials are missing, because the missing trials may be the difficult ones.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from vsnbench.errors import UsageError
from vsnbench.report.analysis.comparability import MIN_COVERAGE
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import ReportData, empty_report_data, goal_order
from vsnbench.report.analysis.summary import ConditionSummary, Group, ReportResults
from vsnbench.report.comparison.effects import MEASURED, EffectComparison, effects
from vsnbench.report.comparison.pairing import (
    Matches,
    Pairing,
    difference_interval,
    match,
    pair,
    rate_difference,
    same_places,
    seeded,
)
from vsnbench.report.comparison.power import AttainableP, DesignPower, attainable_p, design_power
from vsnbench.statistics.clustered import Outcomes
from vsnbench.statistics.conclusion import Conclusion, DifferenceEvidence, conclude
from vsnbench.statistics.multiple import holm
from vsnbench.statistics.paired import paired_test
from vsnbench.statistics.permutation import exchange_clusters, fisher_effective
from vsnbench.statistics.rates import CONFIDENCE, Interval, Proportion, fisher
from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    import pandas as pd

Looks = tuple[tuple[int, int], ...]
"""Episodes of both conditions at each look, in order; the newest is last."""
ALL, SHARED = "all goals", "shared goals"

FLIPPED = "sign flip of starting positions"
MCNEMAR = "McNemar, exact"
EXCHANGED = "permutation of starting positions"
FISHER = "Fisher, exact"
EFFECTIVE = "Fisher, exact, at the effective sample sizes"


@dataclass(frozen=True, slots=True)
class RateComparison:
    """Two success rates on one set of goals."""

    scope: str
    """`all goals`, `shared goals`, or a goal."""
    goals: tuple[tuple[str, ...], tuple[str, ...]]
    """Goals of the first and the second; equal except for `all goals`."""
    first: Group
    """All its episodes on these goals, compared or left out."""
    second: Group
    pairing: Pairing | None
    """None for independent samples."""
    matches: Matches | None
    """Matched episodes; None for independent samples."""
    test: str
    """Name of the test, which is chosen by the design."""
    p: float
    """Two-sided p-value before correction."""
    adjusted_p: float = math.nan
    """`p` after Holm's correction for all comparisons."""
    questions: int = 1
    """Number of comparisons in that correction, for which the interval is simultaneous as well."""
    level: float = 1 - CONFIDENCE
    """Bonferroni level: 0.05 divided by the number of all comparisons."""
    power: DesignPower | None = None
    """Power of the design; None if a difference was found or the power is unknown."""

    @property
    def compared(self) -> tuple[Proportion, Proportion]:
        """Successes and trials that the test, interval and difference use."""
        return self.pairing.proportions if self.pairing else (self.first.proportion, self.second.proportion)

    @property
    def difference(self) -> float:
        """First success rate minus the second; if paired, the mean over the cells."""
        return rate_difference(self.pairing, self.first, self.second)

    @property
    def interval(self) -> Interval:
        """95 % interval of the difference (Newcombe), clustered by starting position and paired if the test is.

        The intervals of all comparisons in the correction hold together with 95 %.
        """
        return difference_interval(self.pairing, self.first, self.second, self.questions)

    @property
    def attainable(self) -> AttainableP:
        """Smallest p-value that this design can give."""
        return attainable_p(self.pairing, self.first.outcomes, self.second.outcomes, by_start=self.test == EXCHANGED)

    @property
    def covered(self) -> bool:
        """Whether enough planned trials of both are completed to name a winner."""
        return min(self.first.coverage, self.second.coverage) >= MIN_COVERAGE

    @property
    def conclusion(self) -> Conclusion:
        """Conclusion after correction for all comparisons."""
        return conclude(
            DifferenceEvidence(self.difference, self.interval, self.adjusted_p, 1 - CONFIDENCE, complete=self.covered)
        )

    @property
    def cells(self) -> tuple[int, int]:
        """Number of cells of each condition's compared episodes."""
        if self.pairing:
            return len(self.pairing.outcomes.cells), len(self.pairing.outcomes.cells)
        return len(self.first.outcomes.cells), len(self.second.outcomes.cells)


@dataclass(frozen=True, slots=True)
class Comparison:
    """All comparisons of one pair of conditions."""

    first: Condition
    second: Condition
    rates: tuple[RateComparison, ...]
    effects: tuple[EffectComparison, ...]
    asked: int
    """Number of p-values in the Holm correction."""
    looks: Looks | None = None
    """Recorded looks at this comparison (`vsnbench.report.comparison.looks`); None if it was not shown alone."""

    @property
    def compares_actions(self) -> bool:
        """Whether numbers of actions are comparable: both models answer with the same kinds."""
        return (self.first.action_kinds, self.first.execution) == (self.second.action_kinds, self.second.execution)

    @property
    def level(self) -> float:
        """Bonferroni level: 0.05 divided by the number of comparisons."""
        return (1 - CONFIDENCE) / max(1, self.asked)


def compare(
    record: ReportData,
    results: ReportResults,
    names: Sequence[str],
    *,
    by_goal: bool = False,
    published: ReportResults | None = None,
    with_power: bool = True,
) -> tuple[Comparison, ...]:
    """Compare every pair of the named conditions.

    Args:
        record: the episodes.
        results: their summaries.
        names: models, or condition names from a report; `paper:vlv` is the paper's result.
        by_goal: also compare each shared goal.
        published: the paper's results.
        with_power: compute the power of designs that found nothing, which takes a second or two per pair.

    Raises:
        UsageError: a name matches no condition or several, or there are fewer than two names.
    """
    if len(names) < 2:
        raise UsageError("name at least two models to compare")
    found = [find_condition(name, results, published) for name in names]
    if len({summary.condition.number for summary in found}) < len(found):
        raise UsageError("a model is named twice; name different models")
    sides = [_side(record, summary) for summary in found]
    pairs = [_pair(a, b, by_goal=by_goal) for a, b in itertools.combinations(sides, 2)]
    # Totals over all goals restate the shared goals, so only the shared goals are corrected for.
    family = [rate.p for comparison in pairs for rate in comparison.rates if rate.scope != ALL]
    pairs = [replace(comparison, asked=len(family)) for comparison in pairs]
    adjusted = iter(holm(family))

    def finished(rate: RateComparison, level: float) -> RateComparison:
        if rate.scope == ALL:
            rate = replace(rate, adjusted_p=rate.p, level=level)
        else:
            rate = replace(rate, adjusted_p=next(adjusted), questions=len(family), level=level)
        if with_power and rate.scope in (ALL, SHARED) and rate.covered and not rate.conclusion.names_winner:
            by_start = rate.test == EXCHANGED
            return replace(rate, power=design_power(rate.pairing, rate.first, rate.second, level, by_start=by_start))
        return rate

    return tuple(
        replace(comparison, rates=tuple(finished(rate, comparison.level) for rate in comparison.rates))
        for comparison in pairs
    )


def find_condition(name: str, results: ReportResults, published: ReportResults | None) -> ConditionSummary:
    """Return the condition with this name.

    Raises:
        UsageError: no condition or several match; the message lists them.
    """
    if name.startswith("paper:"):
        for summary in published.conditions if published else ():
            if summary.condition.model == name.removeprefix("paper:").lower():
                return summary
        raise UsageError(f"the paper has no model {name.removeprefix('paper:')!r}; it has paper:vlv and paper:pirlnav")
    exact = [summary for summary in results.conditions if summary.condition.name == name]
    fitting = exact or [summary for summary in results.conditions if summary.condition.model == name]
    if len(fitting) == 1:
        return fitting[0]
    known = ", ".join(repr(sanitize(summary.condition.name)) for summary in fitting or results.conditions)
    if fitting:
        raise UsageError(f"{sanitize(name)!r} was tested under several conditions; name one of: {known}")
    raise UsageError(
        f"no results of {sanitize(name)!r}; the record has {known}, the paper has paper:vlv and paper:pirlnav"
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One condition with its counted episodes, prepared once for all comparisons."""

    summary: ConditionSummary
    rows: "pd.DataFrame"
    seeded: "pd.DataFrame"


def _side(record: ReportData, summary: ConditionSummary) -> _Side:
    if summary.condition.published:
        record = empty_report_data()
    rows = record.counted(summary.condition)[
        ["episode", "goal", "start", "campaign", "repetition", "success", *MEASURED]
    ]
    if record.courses is not None:
        rows = rows.merge(record.courses.drop(columns="stage"), on="episode", how="left")
    return _Side(summary, rows, seeded(rows, summary.condition))


def _pair(side: _Side, other: _Side, *, by_goal: bool) -> Comparison:
    first, second = side.summary, other.summary
    mine, theirs = first.own_goals, second.own_goals
    shared = tuple(sorted(set(mine) & set(theirs), key=goal_order))
    scopes: list[tuple[str, tuple[str, ...], tuple[str, ...]]] = [(SHARED, shared, shared)] if shared else []
    if set(mine) != set(theirs):
        scopes.insert(0, (ALL, mine, theirs))
    if by_goal and len(shared) > 1:
        scopes += [(goal, (goal,), (goal,)) for goal in shared]
    rates = tuple(_rate(scope, (side, own), (other, others)) for scope, own, others in scopes)
    measured: tuple[EffectComparison, ...] = ()
    if shared and not (first.condition.published or second.condition.published):
        together = same_places(first.condition, second.condition)
        measured = effects(side.rows, other.rows, shared, together=together)
    found = Comparison(first.condition, second.condition, rates, measured, asked=0)
    if not found.compares_actions:
        found = replace(found, effects=tuple(effect for effect in measured if not effect.counts_actions))
    return found


def _rate(scope: str, side: tuple[_Side, tuple[str, ...]], other: tuple[_Side, tuple[str, ...]]) -> RateComparison:
    first, second = (side[0].summary, side[1]), (other[0].summary, other[1])
    a, b = first[0].over(first[1]), second[0].over(second[1])
    pairing = None if scope == ALL else pair(first[0], second[0], first[1])
    matches = match(side[0].seeded, other[0].seeded, first[1]) if pairing else None
    if pairing:
        test, p = MCNEMAR if pairing.single else FLIPPED, paired_test(pairing.outcomes)
    elif a.outcomes.independent and b.outcomes.independent:
        test, p = FISHER, fisher(a.proportion, b.proportion)
    elif _placed(a.outcomes, first[0]) and _placed(b.outcomes, second[0]):
        test, p = EXCHANGED, exchange_clusters(a.outcomes, b.outcomes)
    else:
        test, p = EFFECTIVE, fisher_effective(a.outcomes, b.outcomes)
    return RateComparison(scope, (first[1], second[1]), a, b, pairing, matches, test, p)


def _placed(outcomes: Outcomes, summary: ConditionSummary) -> bool:
    """Whether the starting position of every episode is known."""
    return not summary.condition.published and all(cell.cluster > 0 for cell in outcomes.cells)
