"""Condenses episodes into the numbers of a report: by goal, by starting position, by end reason, in total.

Void episodes are counted beside, never inside; every summary carries how many of its planned trials are done.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from vsnbench.database.read_model import COUNTED, RUNNING, UNJUDGED, VOID
from vsnbench.protocol.judge import EndReason
from vsnbench.report.conditions import Condition
from vsnbench.report.record import Record, goal_order
from vsnbench.statistics.clustered import Cell, Outcomes, rate_interval
from vsnbench.statistics.rates import Interval, Proportion

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray


TRIVIAL_M = 0.25
"""A trial whose shortest path is below one move is trivial: it tells nothing about navigation."""


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
    """Mean over the failures, which count 0, and the successes whose path lengths are known."""
    soft_spl: float
    """Mean over the episodes whose path lengths are known."""
    spl_episodes: int
    """How many `spl` is over."""
    soft_spl_episodes: int
    """How many `soft_spl` is over."""
    median_distance_m: float
    """Of the final distance to the goal, where it is known."""
    collisions: int | None
    step_limits: int | None
    trivial: int | None
    """Episodes that began within one move (`TRIVIAL_M`) of success."""
    outcomes: Outcomes
    """The same episodes cell by cell, for every interval and test; clusters are starting positions."""

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
        """95 % interval of the success rate; Wilson's where no starting position was tried twice."""
        return rate_interval(self.outcomes)

    @property
    def coverage(self) -> float:
        """Trials done of trials planned, 0 to 1."""
        return self.episodes / self.planned if self.planned else math.nan

    @property
    def repeats(self) -> str:
        """What must be said aloud where cells were tried more than once: `75 episodes from 15 cells`; else empty."""
        if not self.outcomes.repeated:
            return ""
        return f"{self.episodes} episodes from {len(self.outcomes.cells)} cells"


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
    # In numpy: a large report makes hundreds of summaries, and pandas takes longer to begin than to count.
    state, ended = _codes(episodes["state"]), _codes(episodes["end_reason"])
    counted = state.of(COUNTED)
    success = episodes["success"].to_numpy()[counted]
    actions = episodes["actions"].to_numpy()[counted]
    spl = _known(episodes["spl"], counted)
    soft_spl = _known(episodes["soft_spl"], counted)
    return Summary(
        successes=int(success.sum()),
        episodes=int(counted.sum()),
        planned=planned,
        void=int(state.of(VOID).sum()),
        unjudged=int(state.of(UNJUDGED).sum()),
        mean_actions=_mean(actions),
        mean_actions_successful=_mean(actions[success]),
        spl=_mean(spl),
        soft_spl=_mean(soft_spl),
        spl_episodes=len(spl),
        soft_spl_episodes=len(soft_spl),
        median_distance_m=_median(_known(episodes["distance_m"], counted)),
        collisions=int(ended.of(EndReason.COLLISION.value)[counted].sum()),
        step_limits=int(ended.of(EndReason.STEP_LIMIT.value)[counted].sum()),
        trivial=int((_known(episodes["shortest_m"], counted) < TRIVIAL_M).sum()),
        outcomes=outcomes_of(episodes[counted]),
    )


def outcomes_of(episodes: "pd.DataFrame", *, by_goal: bool = False) -> Outcomes:
    """Return counted episodes cell by cell, in the order of goals and starting positions.

    Args:
        episodes: rows of `Record.episodes` that count.
        by_goal: the clusters are goals, for what is about one starting position alone; else starting positions. An
            episode whose starting position is not known (0) is a cell and a cluster by itself.
    """
    import numpy as np

    if episodes.empty:
        return Outcomes(())
    goals, starts = episodes["goal"].cat.codes.to_numpy(np.int64), episodes["start"].to_numpy(np.int64)
    # An unknown position is made a number of its own, below 0, from the episode's.
    starts = np.where(starts > 0, starts, -episodes["episode"].to_numpy(np.int64))
    keys, cells = np.unique(np.stack([goals, starts]), axis=1, return_inverse=True)
    trials = np.bincount(cells)
    successes = np.bincount(cells, weights=episodes["success"].to_numpy(np.float64)).astype(np.int64)
    clusters = keys[0 if by_goal else 1]
    return Outcomes(
        tuple(Cell(*each) for each in zip(clusters.tolist(), successes.tolist(), trials.tolist(), strict=True))
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Codes:
    """A categorical column as small numbers."""

    numbers: "NDArray[np.integer[Any]]"
    names: Sequence[str]

    def of(self, name: str) -> "NDArray[np.bool_]":
        """Return which rows have this value."""
        import numpy as np

        if name not in self.names:
            return np.zeros(len(self.numbers), bool)
        return np.asarray(self.numbers == self.names.index(name))


def _codes(column: "pd.Series[str]") -> _Codes:
    return _Codes(column.cat.codes.to_numpy(), list(column.cat.categories))


def _known(column: "pd.Series[float]", rows: "NDArray[np.bool_]") -> "NDArray[np.float64]":
    """Return what is not NaN in these rows."""
    import numpy as np

    numbers = column.to_numpy(np.float64)[rows]
    return np.asarray(numbers[~np.isnan(numbers)], np.float64)


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
            StartSummary(int(start), _of_start(by_start.get(start, nothing), int(trials_by_start[start])))
            for start in sorted(trials_by_start.index)
        ),
        ends=_ends(episodes),
    )


def _of_start(episodes: "pd.DataFrame", planned: int) -> Summary:
    counted = episodes[episodes["state"] == COUNTED]
    return replace(summary_of(episodes, planned), outcomes=outcomes_of(counted, by_goal=True))


def _ends(episodes: "pd.DataFrame") -> tuple[EndCount, ...]:
    state, ended = _codes(episodes["state"]), _codes(episodes["end_reason"])
    over, counted = ~state.of(RUNNING), state.of(COUNTED)
    order = [reason.value for reason in EndReason]
    reasons = [*order, *sorted(set(ended.names) - set(order))]
    counts = (
        EndCount(reason, int((of := ended.of(reason) & over).sum()), int((of & counted).sum())) for reason in reasons
    )
    return tuple(count for count in counts if count.attempts)


def _of(frame: "pd.DataFrame", condition: Condition) -> "pd.DataFrame":
    return frame[frame["condition"] == condition.number]


def _mean(numbers: "NDArray[Any]") -> float:
    return float(numbers.mean()) if len(numbers) else math.nan


def _median(numbers: "NDArray[np.float64]") -> float:
    import numpy as np

    return float(np.median(numbers)) if len(numbers) else math.nan
