"""Condenses episodes into the numbers of a report: by goal, by starting position, by end reason, in total.

Void episodes are counted beside, never inside; every summary carries how many of its planned trials are done.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from vsnbench.database.read_model import COUNTED, RUNNING, UNJUDGED, VOID
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import TRIVIAL_M
from vsnbench.report.conditions import Condition
from vsnbench.report.peers import shared_goals
from vsnbench.report.record import Codes, EpisodeColumns, Record, goal_order
from vsnbench.statistics.clustered import Cell, Outcomes, rate_interval
from vsnbench.statistics.rates import Interval, Proportion

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from vsnbench.report.record import Integers, Rows


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
    """Mean over the failures, which count 0, and the successes whose path lengths are known; NaN where there are
    successes and the length of none is known."""
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
    """Total over `shared_goals`; None when that says nothing new."""
    starts: tuple[StartSummary, ...]
    ends: tuple[EndCount, ...]
    shared_goals: tuple[str, ...] = ()
    """Goals that all who can be laid beside it were asked for, in the order of the tables (`peers.shared_goals`)."""

    @property
    def never_succeeding(self) -> tuple[int, ...]:
        """Starting positions that were tried and never succeeded from."""
        return tuple(one.start for one in self.starts if one.summary.episodes and not one.summary.successes)


@dataclass(frozen=True, slots=True)
class Results:
    """All conditions of a report."""

    conditions: tuple[ConditionSummary, ...]

    @property
    def episodes(self) -> int:
        """Episodes that count, over all conditions."""
        return sum(one.total.episodes for one in self.conditions)


@dataclass(frozen=True, slots=True, eq=False)
class CellCounts:
    """Successes and trials, cell by cell, in the order of goals and starting positions; an entry a cell."""

    goals: "Integers"
    """Their codes."""
    starts: "Integers"
    """An episode whose position is not known is a cell by itself: its number below 0."""
    successes: "Integers"
    trials: "Integers"

    @classmethod
    def of(cls, goals: "Integers", starts: "Integers", episodes: "Integers", success: "NDArray[np.bool_]") -> Self:
        """Count episodes that count.

        Args:
            goals: (episodes,) code of the goal.
            starts: (episodes,) number of the starting position; 0 for one that is not known.
            episodes: (episodes,) number of the episode.
            success: (episodes,) whether it succeeded.
        """
        import numpy as np

        places = np.where(starts > 0, starts, -episodes)
        order = np.lexsort((places, goals))
        goals, places, success = goals[order].astype(np.int64), places[order], success[order]
        if not len(order):
            return cls(goals, places, places, places)
        first = np.ones(len(order), bool)
        first[1:] = (goals[1:] != goals[:-1]) | (places[1:] != places[:-1])
        begins = np.flatnonzero(first)
        successes = np.add.reduceat(success.astype(np.int64), begins)
        return cls(goals[begins], places[begins], successes, np.diff(begins, append=len(order)))

    def outcomes(self, cells: "Rows" = slice(None), *, by_goal: bool = False) -> Outcomes:
        """Return some of the cells.

        Args:
            cells: which; all when absent.
            by_goal: the clusters are goals, for what is about one starting position alone; else starting positions.
        """
        clusters = self.goals if by_goal else self.starts
        listed = (each[cells].tolist() for each in (clusters, self.successes, self.trials))
        return Outcomes(tuple(Cell(*each) for each in zip(*listed, strict=True)))


def outcomes_of(episodes: "pd.DataFrame") -> Outcomes:
    """Return the outcomes, cell by cell, of rows of `Record.episodes` that count; clusters are starting positions."""
    import numpy as np

    goals = episodes["goal"].cat.codes.to_numpy()
    starts, numbers = (episodes[name].to_numpy(np.int64) for name in ("start", "episode"))
    return CellCounts.of(goals, starts, numbers, episodes["success"].to_numpy(bool)).outcomes()


def summarise(record: Record) -> Results:
    """Condense a record into its tables."""
    everything = EpisodeColumns.of(record.episodes)
    episodes, none = dict(everything.by(everything.condition)), everything[:0]
    planned = {one.number: record.planned[record.planned["condition"] == one.number] for one in record.conditions}
    shared = shared_goals(
        record.conditions,
        asked={number: set(trials["goal"].astype(str)) for number, trials in planned.items()},
        done={
            number: (int(episodes.get(number, none).state.of(COUNTED).sum()), int(trials["trials"].sum()))
            for number, trials in planned.items()
        },
    )
    return Results(
        tuple(
            _condition(one, episodes.get(one.number, none), planned[one.number], shared[one.number])
            for one in record.conditions
        )
    )


def _condition(
    condition: Condition, episodes: EpisodeColumns, planned: "pd.DataFrame", shared: set[str]
) -> ConditionSummary:
    names, none = episodes.goal.names, episodes[:0]
    cells = _cells(episodes)
    by_goal = {names[code]: mine for code, mine in episodes.by(episodes.goal.numbers)}
    by_start = dict(episodes.by(episodes.start))
    trials_by_goal = planned.groupby("goal", observed=True)["trials"].sum()
    trials_by_start = planned.groupby("start")["trials"].sum()

    def on(*goals: str) -> Outcomes:
        return cells.outcomes(Codes(cells.goals, names).of(*goals))

    goals = tuple(
        GoalSummary(goal, _summary(by_goal.get(goal, none), int(trials_by_goal[goal]), on(goal)))
        for goal in sorted(trials_by_goal.index, key=goal_order)
    )
    own = {one.goal for one in goals}
    common = None
    if shared and shared < own:
        trials = int(planned.loc[planned["goal"].isin(shared), "trials"].sum())
        common = _summary(episodes[episodes.goal.of(*shared)], trials, on(*shared))
    return ConditionSummary(
        condition=condition,
        goals=goals,
        total=_summary(episodes, int(planned["trials"].sum()), cells.outcomes()),
        shared=common,
        starts=tuple(
            StartSummary(start, _of_start(start, by_start.get(start, none), int(trials_by_start[start]), cells))
            for start in sorted(trials_by_start.index.tolist())
        ),
        ends=_ends(episodes),
        shared_goals=tuple(sorted(shared, key=goal_order)),
    )


def _cells(episodes: EpisodeColumns) -> CellCounts:
    counted = episodes[episodes.state.of(COUNTED)]
    return CellCounts.of(counted.goal.numbers, counted.start, counted.episode, counted.success)


def _of_start(start: int, episodes: EpisodeColumns, planned: int, cells: CellCounts) -> Summary:
    if start > 0:
        return _summary(episodes, planned, cells.outcomes(cells.starts == start, by_goal=True))
    return _summary(episodes, planned, _cells(episodes).outcomes(by_goal=True))  # a cell is an episode there


def _summary(episodes: EpisodeColumns, planned: int, outcomes: Outcomes) -> Summary:
    """Condense episodes, whatever their states; the outcomes are of those that count."""
    import numpy as np

    state = episodes.state
    counted = episodes[state.of(COUNTED)]
    spl, soft_spl = _known(counted.spl), _known(counted.soft_spl)
    if counted.success.any() and not (~np.isnan(counted.spl[counted.success])).any():
        spl = spl[:0]  # the failures' zeros alone would say that successes are worth nothing
    return Summary(
        successes=int(counted.success.sum()),
        episodes=len(counted.success),
        planned=planned,
        void=int(state.of(VOID).sum()),
        unjudged=int(state.of(UNJUDGED).sum()),
        mean_actions=_mean(counted.actions),
        mean_actions_successful=_mean(counted.actions[counted.success]),
        spl=_mean(spl),
        soft_spl=_mean(soft_spl),
        spl_episodes=len(spl),
        soft_spl_episodes=len(soft_spl),
        median_distance_m=_median(_known(counted.distance_m)),
        collisions=int(counted.end_reason.of(EndReason.COLLISION.value).sum()),
        step_limits=int(counted.end_reason.of(EndReason.STEP_LIMIT.value).sum()),
        trivial=int((_known(counted.shortest_m) < TRIVIAL_M).sum()),
        outcomes=outcomes,
    )


def _known(numbers: "NDArray[np.float64]") -> "NDArray[np.float64]":
    """Return what is not NaN."""
    import numpy as np

    return np.asarray(numbers[~np.isnan(numbers)], np.float64)


def _ends(episodes: EpisodeColumns) -> tuple[EndCount, ...]:
    state, ended = episodes.state, episodes.end_reason
    over, counted = ~state.of(RUNNING), state.of(COUNTED)
    order = [reason.value for reason in EndReason]
    reasons = [*order, *sorted(set(ended.names) - set(order))]
    counts = (
        EndCount(reason, int((of := ended.of(reason) & over).sum()), int((of & counted).sum())) for reason in reasons
    )
    return tuple(count for count in counts if count.attempts)


def _mean(numbers: "NDArray[Any]") -> float:
    """Return the mean, to the bit the same whatever the order in which the episodes were run."""
    import numpy as np

    return float(np.sort(numbers).mean()) if len(numbers) else math.nan


def _median(numbers: "NDArray[np.float64]") -> float:
    import numpy as np

    return float(np.median(numbers)) if len(numbers) else math.nan
