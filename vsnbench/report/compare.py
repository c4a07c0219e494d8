"""Compares two conditions honestly: the difference with its interval, the right test for the design, and in words.

Trials are paired on (goal, starting position, repetition) where both were run in the same site; else the samples are
independent. No winner is named while trials are missing: the missing ones may be the hard ones.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from vsnbench.errors import UsageError
from vsnbench.harmless_text import harmless
from vsnbench.report.conditions import Condition
from vsnbench.report.record import Record, goal_order
from vsnbench.report.summary import ConditionSummary, Results, Summary
from vsnbench.statistics.rates import (
    CONFIDENCE,
    ClusterSums,
    Interval,
    Proportion,
    Stratum,
    barnard,
    clustered_bootstrap,
    fisher,
    holm,
    mcnemar_exact,
    newcombe,
    stratified_permutation,
    trials_needed,
)

if TYPE_CHECKING:
    import pandas as pd

ENOUGH_COVERAGE = 0.95
"""Below this share of trials done, no winner is named."""

ALL, SHARED = "all goals", "shared goals"


@dataclass(frozen=True, slots=True)
class PairedTest:
    """What matched trials say."""

    pairs: int
    only_first: int
    """Pairs in which only the first succeeded."""
    only_second: int
    mcnemar_p: float
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
    second: Summary
    fisher_p: float
    barnard_p: float
    """NaN where there are too many trials for it."""
    paired: PairedTest | None
    adjusted_p: float
    """The p-value that is read (McNemar's when paired, else Fisher's), after Holm over everything asked together."""

    @property
    def p(self) -> float:
        """The p-value that is read, before any correction."""
        return self.paired.mcnemar_p if self.paired else self.fisher_p

    @property
    def difference(self) -> float:
        """First success rate less the second, as shares."""
        return self.first.success_rate - self.second.success_rate

    @property
    def interval(self) -> Interval:
        """Newcombe's 95 % interval of the difference."""
        return newcombe(self.first.proportion, self.second.proportion)

    @property
    def covered(self) -> bool:
        """Whether enough of the planned trials of both are done to name a winner."""
        return min(self.first.coverage, self.second.coverage) >= ENOUGH_COVERAGE

    @property
    def significant(self) -> bool:
        """Whether the difference is beyond chance, corrected for everything asked together."""
        return self.adjusted_p < 1 - CONFIDENCE

    @property
    def more_trials(self) -> int | None:
        """About how many more trials a model would show the difference seen with 80 % power; None for no difference."""
        needed = trials_needed(self.first.success_rate, self.second.success_rate)
        return None if needed is None else max(0, needed - min(self.first.episodes, self.second.episodes))


@dataclass(frozen=True, slots=True)
class EffectComparison:
    """Two means of a measure on the shared goals, with an interval that respects the starting positions."""

    measure: str
    first: float
    second: float
    interval: Interval
    """Of the difference; unknown where there is too little to resample."""

    @property
    def difference(self) -> float:
        """First less second."""
        return self.first - self.second


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
    def verdicts(self) -> tuple[str, ...]:
        """Each set of goals in one plain sentence or two."""
        return tuple(_verdict(self, rate) for rate in self.rates)


def compare(
    record: Record, results: Results, names: Sequence[str], *, by_goal: bool = False, published: Results | None = None
) -> tuple[Comparison, ...]:
    """Compare every pair of the named conditions.

    Args:
        record: the episodes.
        results: their summaries.
        names: models, or conditions as reports name them; `paper:vlv` is the paper's.
        by_goal: each shared goal by itself as well.
        published: the paper's results.

    Raises:
        UsageError: a name fits no condition or several, or there are fewer than two.
    """
    if len(names) < 2:
        raise UsageError("name at least two models to compare")
    found = [find_condition(name, results, published) for name in names]
    if len({one.condition.number for one in found}) < len(found):
        raise UsageError("a comparison needs different models: one is named twice")
    raw = [_pair(record, a, b, by_goal=by_goal) for a, b in itertools.combinations(found, 2)]
    # The totals over all goals restate the shared ones: the family is what is asked, on the goals that can be compared.
    family = [rate.p for one in raw for rate in one.rates if rate.scope != ALL]
    adjusted = iter(holm(family))
    finished = []
    for one in raw:
        rates = tuple(replace(rate, adjusted_p=rate.p if rate.scope == ALL else next(adjusted)) for rate in one.rates)
        finished.append(replace(one, rates=rates, asked=len(family)))
    return tuple(finished)


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


def _pair(record: Record, first: ConditionSummary, second: ConditionSummary, *, by_goal: bool) -> Comparison:
    mine, theirs = (tuple(goal.goal for goal in one.goals) for one in (first, second))
    shared = tuple(sorted(set(mine) & set(theirs), key=goal_order))
    scopes: list[tuple[str, tuple[str, ...], tuple[str, ...]]] = [(SHARED, shared, shared)] if shared else []
    if set(mine) != set(theirs):
        scopes.insert(0, (ALL, mine, theirs))
    if by_goal and len(shared) > 1:
        scopes += [(goal, (goal,), (goal,)) for goal in shared]
    rates = []
    for scope, own, other in scopes:
        a, b = _summary(first, own), _summary(second, other)
        paired = None if scope == ALL else _paired(record, first, second, own)
        fisher_p = fisher(a.proportion, b.proportion)
        rates.append(
            RateComparison(
                scope=scope,
                goals=(own, other),
                first=a,
                second=b,
                fisher_p=fisher_p,
                barnard_p=barnard(a.proportion, b.proportion),
                paired=paired,
                adjusted_p=math.nan,
            )
        )
    return Comparison(first.condition, second.condition, tuple(rates), _effects(record, first, second, shared), 0)


def _summary(one: ConditionSummary, goals: Sequence[str]) -> Summary:
    """Sum up some goals; only what rates need."""
    chosen = [goal.summary for goal in one.goals if goal.goal in goals]
    first = chosen[0]
    return replace(
        first,
        successes=sum(each.successes for each in chosen),
        episodes=sum(each.episodes for each in chosen),
        planned=sum(each.planned for each in chosen),
    )


def _episodes(record: Record, one: ConditionSummary, goals: Sequence[str]) -> "pd.DataFrame":
    rows = record.counted(one.condition)
    return rows[rows["goal"].isin(goals)]


def _same_places(first: ConditionSummary, second: ConditionSummary) -> bool:
    return bool(first.condition.site_sha256) and first.condition.site_sha256 == second.condition.site_sha256


def _paired(
    record: Record, first: ConditionSummary, second: ConditionSummary, goals: Sequence[str]
) -> PairedTest | None:
    if not _same_places(first, second):
        return None
    cell = ["goal", "start", "repetition"]
    sides = []
    for one in (first, second):
        rows = _episodes(record, one, goals)[[*cell, "success"]].astype({"goal": str})
        # Campaigns with other seeds meet the same cells again: the n-th time is paired with the n-th time.
        sides.append(rows.assign(time=rows.groupby(cell).cumcount()))
    pairs = sides[0].merge(sides[1], on=[*cell, "time"], suffixes=("_first", "_second"))
    if pairs.empty:
        return None
    a, b = pairs["success_first"], pairs["success_second"]
    only_first, only_second = int((a & ~b).sum()), int((~a & b).sum())
    by_start = pairs.groupby("start")[["success_first", "success_second"]].agg(["sum", "count"])
    strata = [
        Stratum(Proportion(int(k1), int(n1)), Proportion(int(k2), int(n2)))
        for k1, n1, k2, n2 in by_start.itertuples(index=False)
    ]
    return PairedTest(
        pairs=len(pairs),
        only_first=only_first,
        only_second=only_second,
        mcnemar_p=mcnemar_exact(only_first, only_second),
        permutation_p=stratified_permutation(strata),
    )


MEASURES = {
    "actions": "actions",
    "actions of successful episodes": "actions",
    "SPL": "spl",
    "SoftSPL": "soft_spl",
}


def _effects(
    record: Record, first: ConditionSummary, second: ConditionSummary, goals: Sequence[str]
) -> tuple[EffectComparison, ...]:
    if first.condition.published or second.condition.published or not goals:
        return ()
    sides = [_episodes(record, one, goals) for one in (first, second)]
    effects = []
    for measure, column in MEASURES.items():
        chosen = [rows[rows["success"]] if "successful" in measure else rows for rows in sides]
        # The same starting positions are drawn for both when they are the same places.
        starts = sorted(set(sides[0]["start"]) | set(sides[1]["start"])) if _same_places(first, second) else None
        a, b = (_by_start(rows, column, starts) for rows in chosen)
        interval = clustered_bootstrap(a, b, shared_clusters=starts is not None)
        effects.append(EffectComparison(measure, a.mean, b.mean, interval))
    return tuple(effects)


def _by_start(rows: "pd.DataFrame", column: str, starts: Sequence[int] | None) -> ClusterSums:
    import numpy as np

    grouped = rows.groupby("start")[column].agg(["sum", "count"])
    if starts is not None:
        grouped = grouped.reindex(list(starts), fill_value=0)
    return ClusterSums(grouped["sum"].to_numpy(np.float64), grouped["count"].to_numpy(np.int64))


def _verdict(comparison: Comparison, rate: RateComparison) -> str:
    a, b = harmless(comparison.first.name), harmless(comparison.second.name)
    where = f"On {rate.scope}" if rate.scope in (ALL, SHARED) else f"On {harmless(rate.scope)}"
    caveat = " Their goals differ: the difference may be the goals' and not the models'." if rate.scope == ALL else ""
    if not rate.first.episodes or not rate.second.episodes:
        empty = a if not rate.first.episodes else b
        return f"{where}: nothing to compare, no trial of {empty} is done."
    interval = rate.interval
    numbers = (
        f"{rate.first.successes}/{rate.first.episodes} against {rate.second.successes}/{rate.second.episodes}, "
        f"{100 * rate.difference:+.1f} points [{100 * interval.low:+.1f}, {100 * interval.high:+.1f}]"
    )
    if not rate.covered:
        short = [
            f"{each.episodes} of {each.planned} trials of {name}"
            for name, each in ((a, rate.first), (b, rate.second))
            if each.coverage < ENOUGH_COVERAGE
        ]
        return (
            f"{where}: {numbers}. No winner is named: only {' and '.join(short)} are done, "
            f"{ENOUGH_COVERAGE:.0%} are needed.{caveat}"
        )
    p = f"p {_compared(rate.p)}"
    if rate.scope != ALL and comparison.asked > 1:
        p += f", {_compared(rate.adjusted_p)} after Holm's correction for {comparison.asked} questions"
    for one in (comparison.first, comparison.second):
        if one.surveyed:
            caveat += f" {harmless(one.name)} is handed the site: an upper bound, not a competitor."
    if rate.significant:
        better, worse = (a, b) if rate.difference > 0 else (b, a)
        return f"{where}: {better} succeeds more often than {worse}: {numbers}, {p}.{caveat}"
    more = rate.more_trials
    advice = (
        "the rates seen are equal"
        if more is None
        else f"about {more} more trials a model would be needed for 80 % power to show the difference seen"
        if more
        else "the trials would have been enough for 80 % power, the difference seen is chance or smaller than it looks"
    )
    return f"{where}: not distinguishable at this number of trials ({numbers}, {p}); {advice}.{caveat}"


def _compared(p: float) -> str:
    return f"= {p:.3f}" if p >= 0.001 else "< 0.001"
