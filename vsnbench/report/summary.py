"""Condenses episodes into the numbers of a report: by goal, by starting position, by end reason, in total.

Void episodes are counted beside, never inside; every summary carries how many of its planned trials are done.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.protocol.judge import EndReason
from vsnbench.report.record import COUNTED, RUNNING, UNJUDGED, VOID, Condition, Record, goal_order
from vsnbench.report.statistics import Interval, Proportion, wilson

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Summary:
    """The numbers of a group of episodes; a mean or median of nothing is NaN."""

    successes: int
    episodes: int
    """Episodes that count: one a trial."""
    planned: int
    """Trials planned."""
    void: int | None
    """Attempts that were no result; not among `episodes`. None when it is not known, as of published numbers."""
    unjudged: int
    """Results that await a verdict; not among `episodes`."""
    mean_actions: float
    """Over all episodes that count: the paper's "average number of actions"."""
    mean_actions_successful: float
    """Over the successful ones only."""
    spl: float
    """Mean over the episodes whose path lengths are known."""
    soft_spl: float
    spl_episodes: int
    """How many those are."""
    median_distance_m: float
    """Of the final distance to the goal, where it is known."""
    collisions: int | None
    step_limits: int | None

    @property
    def proportion(self) -> Proportion:
        """Successes of episodes."""
        return Proportion(self.successes, self.episodes)

    @property
    def success_rate(self) -> float:
        """Share of successes, 0 to 1; NaN for no episodes."""
        return self.proportion.rate

    @property
    def interval(self) -> Interval:
        """Wilson's 95 % interval of the success rate."""
        return wilson(self.proportion)

    @property
    def coverage(self) -> float:
        """Trials done of trials planned, 0 to 1."""
        return self.episodes / self.planned if self.planned else math.nan


@dataclass(frozen=True, slots=True)
class GoalSummary:
    """One goal category under one condition."""

    goal: str
    summary: Summary


@dataclass(frozen=True, slots=True)
class StartSummary:
    """One starting position under one condition, over all goals."""

    start: int
    summary: Summary


@dataclass(frozen=True, slots=True)
class EndCount:
    """How many attempts ended for one reason."""

    end_reason: str
    attempts: int
    counted: int
    """How many of them are episodes that count."""


@dataclass(frozen=True, slots=True)
class ConditionSummary:
    """Everything that the tables say about one condition."""

    condition: Condition
    goals: tuple[GoalSummary, ...]
    total: Summary
    shared: Summary | None
    """Total over the goals that all conditions of the report have in common; None when that says nothing new."""
    starts: tuple[StartSummary, ...]
    ends: tuple[EndCount, ...]

    @property
    def never_succeeding(self) -> tuple[int, ...]:
        """Starting positions that were tried and never succeeded from."""
        return tuple(one.start for one in self.starts if one.summary.episodes and not one.summary.successes)


@dataclass(frozen=True, slots=True)
class Results:
    """All conditions of a report."""

    conditions: tuple[ConditionSummary, ...]
    shared_goals: tuple[str, ...]
    """Goals that every condition was asked for, in the order of the tables."""

    @property
    def episodes(self) -> int:
        """Episodes that count, over all conditions."""
        return sum(one.total.episodes for one in self.conditions)


def summarise(record: Record) -> Results:
    """Condense a record into its tables."""
    asked = {one.number: set(_of(record.planned, one)["goal"].astype(str)) for one in record.conditions}
    shared = set.intersection(*asked.values()) if asked else set()
    return Results(
        conditions=tuple(_condition(record, one, shared) for one in record.conditions),
        shared_goals=tuple(sorted(shared, key=goal_order)),
    )


def summary_of(episodes: "pd.DataFrame", planned: int) -> Summary:
    """Condense rows of `Record.episodes`, whatever their states."""
    counted = episodes[episodes["state"] == COUNTED]
    measured = counted["spl"].notna()
    return Summary(
        successes=int(counted["success"].sum()),
        episodes=len(counted),
        planned=planned,
        void=int((episodes["state"] == VOID).sum()),
        unjudged=int((episodes["state"] == UNJUDGED).sum()),
        mean_actions=_mean(counted["actions"]),
        mean_actions_successful=_mean(counted.loc[counted["success"], "actions"]),
        spl=_mean(counted.loc[measured, "spl"]),
        soft_spl=_mean(counted["soft_spl"].dropna()),
        spl_episodes=int(measured.sum()),
        median_distance_m=_median(counted["distance_m"].dropna()),
        collisions=int((counted["end_reason"] == EndReason.COLLISION.value).sum()),
        step_limits=int((counted["end_reason"] == EndReason.STEP_LIMIT.value).sum()),
    )


def _condition(record: Record, condition: Condition, shared: set[str]) -> ConditionSummary:
    episodes, planned = record.of(condition), _of(record.planned, condition)
    by_goal = dict(iter(episodes.groupby("goal", observed=True)))
    by_start = dict(iter(episodes.groupby("start")))
    trials_by_goal = planned.groupby("goal", observed=True)["trials"].sum()
    trials_by_start = planned.groupby("start")["trials"].sum()
    nothing = episodes.iloc[:0]
    goals = tuple(
        GoalSummary(goal, summary_of(by_goal.get(goal, nothing), int(trials_by_goal[goal])))
        for goal in sorted(trials_by_goal.index, key=goal_order)
    )
    own = {one.goal for one in goals}
    common = None
    if shared and shared != own:
        trials = int(planned.loc[planned["goal"].isin(shared), "trials"].sum())
        common = summary_of(episodes[episodes["goal"].isin(shared)], trials)
    return ConditionSummary(
        condition=condition,
        goals=goals,
        total=summary_of(episodes, int(planned["trials"].sum())),
        shared=common,
        starts=tuple(
            StartSummary(int(start), summary_of(by_start.get(start, nothing), int(trials_by_start[start])))
            for start in sorted(trials_by_start.index)
        ),
        ends=_ends(episodes),
    )


def _ends(episodes: "pd.DataFrame") -> tuple[EndCount, ...]:
    ended = episodes[episodes["state"] != RUNNING]
    attempts = ended["end_reason"].astype(str).value_counts()
    counted = ended.loc[ended["state"] == COUNTED, "end_reason"].astype(str).value_counts()
    order = [reason.value for reason in EndReason]
    known = [reason for reason in order if reason in attempts.index]
    strange = sorted(set(attempts.index) - set(order))
    return tuple(EndCount(reason, int(attempts[reason]), int(counted.get(reason, 0))) for reason in known + strange)


def _of(frame: "pd.DataFrame", condition: Condition) -> "pd.DataFrame":
    return frame[frame["condition"] == condition.number]


def _mean(values: "Iterable[float] | pd.Series[float]") -> float:
    import numpy as np

    numbers = np.asarray(values, np.float64)
    return float(numbers.mean()) if len(numbers) else math.nan


def _median(values: "Sequence[float] | pd.Series[float]") -> float:
    import numpy as np

    numbers = np.asarray(values, np.float64)
    return float(np.median(numbers)) if len(numbers) else math.nan
