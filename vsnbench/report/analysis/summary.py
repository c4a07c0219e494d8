"""Statistics of a report: by goal, starting position and end reason, and in total.

Void episodes are never included in the rates; every summary has the number of planned trials.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import TRIVIAL_M
from vsnbench.report.analysis.cell_counts import CellCounts
from vsnbench.report.analysis.comparability import shared_goals, shortcoming
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import Codes, EpisodeColumns, ReportData, goal_order
from vsnbench.results.goals import RecordedGoal
from vsnbench.results.reading.read_model import COUNTED, RUNNING, UNJUDGED, VOID
from vsnbench.statistics.clustered import Outcomes, rate_interval
from vsnbench.statistics.rates import Interval, Proportion
from vsnbench.values.goal import GoalKind

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Summary:
    """Statistics of a group of episodes; unknown means and medians are NaN, unknown counts None."""

    successes: int
    episodes: int
    """Counted episodes, one per trial."""
    planned: int
    """Planned trials."""
    mean_actions: float
    """Mean over all counted episodes, as in the paper."""
    outcomes: Outcomes
    """Outcomes of the same episodes by cell; clusters are starting positions."""
    void: int | None = None
    """Void attempts, not in `episodes`."""
    unjudged: int = 0
    """Results without a verdict, not in `episodes`."""
    mean_actions_successful: float = math.nan
    """Mean over the successful episodes."""
    spl: float = math.nan
    """Mean over failures (0) and successes with known path length; NaN if no success has a known length."""
    soft_spl: float = math.nan
    """Mean over the episodes with known path lengths."""
    spl_episodes: int = 0
    """Number of episodes in `spl`."""
    soft_spl_episodes: int = 0
    """Number of episodes in `soft_spl`."""
    progress: float = math.nan
    """Mean over the episodes with known shortest paths."""
    progress_episodes: int = 0
    """Number of episodes in `progress`."""
    sct: float = math.nan
    """Mean over failures (0) and successes with known time; NaN if no success has a known time."""
    sct_episodes: int = 0
    """Number of episodes in `sct`."""
    mean_driving_s: float = math.nan
    """Mean duration on the robot's clock, over the episodes with known duration."""
    mean_thinking_s: float = math.nan
    """Mean inference time on a real robot, over the episodes with known time; NaN in simulation."""
    median_distance_m: float = math.nan
    """Median of the known final distances to the goal."""
    collisions: int | None = None
    step_limits: int | None = None
    time_limits: int | None = None
    path_limits: int | None = None
    trivial: int | None = None
    """Episodes that began within one move (`TRIVIAL_M`) of success."""

    @property
    def proportion(self) -> Proportion:
        """Successes and episodes."""
        return Proportion(self.successes, self.episodes)

    @property
    def limits(self) -> int | None:
        """Episodes that reached a limit of the protocol; None if unknown."""
        if self.step_limits is None:
            return None
        return self.step_limits + (self.time_limits or 0) + (self.path_limits or 0)

    @property
    def success_rate(self) -> float:
        """Success rate, 0 to 1; NaN without episodes."""
        return self.proportion.rate

    @property
    def interval(self) -> Interval:
        """95 % interval of the success rate; Wilson's if every starting position has one episode."""
        return rate_interval(self.outcomes)

    @property
    def coverage(self) -> float:
        """Completed trials divided by planned trials."""
        return self.episodes / self.planned if self.planned else math.nan

    @property
    def repeats(self) -> str:
        """`75 episodes from 15 cells` if cells have repetitions, otherwise empty."""
        if not self.outcomes.repeated:
            return ""
        return f"{self.episodes} episodes from {len(self.outcomes.cells)} cells"


@dataclass(frozen=True, slots=True)
class GoalSummary:
    """One goal under one condition."""

    goal: str
    summary: Summary
    kind: GoalKind = GoalKind.CATEGORY

    @property
    def title(self) -> str:
        """The goal, with its kind if it is not a category."""
        return goal_title(self.goal, self.kind)


def goal_title(goal: str, kind: GoalKind) -> str:
    """Return a goal's name for tables, with its kind if it is not a category."""
    return goal if kind is GoalKind.CATEGORY else f"{goal} ({kind})"


@dataclass(frozen=True, slots=True)
class EndCount:
    """Number of attempts with one end reason."""

    end_reason: str
    attempts: int
    counted: int
    """Number of counted episodes among them."""


@dataclass(frozen=True, slots=True)
class ConditionSummary:
    """Statistics of one condition."""

    condition: Condition
    goals: tuple[GoalSummary, ...]
    total: Summary
    shared: Summary | None
    """Total over `shared_goals`; None if it equals the total."""
    starts: Mapping[int, Summary]
    """Starting position -> summary over all goals, in order; 0 for an import without starting positions."""
    ends: tuple[EndCount, ...]
    shared_goals: tuple[str, ...] = ()
    """Goals shared with comparable conditions (`comparability.shared_goals`), in the order of the tables."""
    kinds: Mapping[GoalKind, Summary] = field(default_factory=dict)
    """Totals by kind of goal; empty if all goals are of one kind."""

    @property
    def shortcoming(self) -> str:
        """Why the data do not suffice for a comparison, or an empty string."""
        return shortcoming(self.total.episodes, self.total.planned)

    @property
    def is_competitor(self) -> bool:
        """Whether the condition can be compared: no access to the site file, and enough completed trials."""
        return not self.condition.surveyed and not self.shortcoming

    @property
    def never_succeeding(self) -> tuple[int, ...]:
        """Starting positions with episodes but without success."""
        return tuple(start for start, summary in self.starts.items() if summary.episodes and not summary.successes)


@dataclass(frozen=True, slots=True)
class Results:
    """All conditions of a report."""

    conditions: tuple[ConditionSummary, ...]

    @property
    def episodes(self) -> int:
        """Counted episodes over all conditions."""
        return sum(summary.total.episodes for summary in self.conditions)


def summarise(record: ReportData) -> Results:
    """Compute the statistics of all conditions."""
    everything = EpisodeColumns.of(record.episodes)
    episodes, none = dict(everything.by(everything.condition)), everything[:0]
    planned = {
        condition.number: record.planned[record.planned["condition"] == condition.number]
        for condition in record.conditions
    }
    shared = shared_goals(
        record.conditions,
        asked={number: set(trials["goal"].astype(str)) for number, trials in planned.items()},
        done={
            number: (int(episodes.get(number, none).state.of(COUNTED).sum()), int(trials["trials"].sum()))
            for number, trials in planned.items()
        },
    )
    numbered = [(condition.number, condition) for condition in record.conditions]
    return Results(
        tuple(
            _condition(condition, episodes.get(number, none), planned[number], shared[number], record.goals)
            for number, condition in numbered
        )
    )


def _condition(
    condition: Condition,
    episodes: EpisodeColumns,
    planned: "pd.DataFrame",
    shared: set[str],
    definitions: Mapping[str, RecordedGoal],
) -> ConditionSummary:
    names, none = episodes.goal.names, episodes[:0]
    cells = _cells(episodes)
    by_goal = {names[code]: mine for code, mine in episodes.by(episodes.goal.numbers)}
    by_start = dict(episodes.by(episodes.start))
    trials_by_goal = planned.groupby("goal", observed=True)["trials"].sum()
    trials_by_start = planned.groupby("start")["trials"].sum()

    def kind_of(goal: str) -> GoalKind:
        return definitions[goal].kind if goal in definitions else GoalKind.CATEGORY

    def on(*goals: str) -> Outcomes:
        return cells.outcomes(Codes(cells.goals, names).of(*goals))

    goals = tuple(
        GoalSummary(goal, _summary(by_goal.get(goal, none), int(trials_by_goal[goal]), on(goal)), kind_of(goal))
        for goal in sorted(trials_by_goal.index, key=goal_order)
    )
    kinds = [kind for kind in GoalKind if kind in {goal.kind for goal in goals}]

    def total_of(goals: Collection[str]) -> Summary:
        trials = int(planned.loc[planned["goal"].isin(goals), "trials"].sum())
        return _summary(episodes[episodes.goal.of(*goals)], trials, on(*goals))

    common = None
    if shared and shared < {goal.goal for goal in goals}:
        common = total_of(shared)
    return ConditionSummary(
        condition=condition,
        goals=goals,
        total=_summary(episodes, int(planned["trials"].sum()), cells.outcomes()),
        shared=common,
        starts={
            start: _of_start(start, by_start.get(start, none), int(trials_by_start[start]), cells)
            for start in sorted(trials_by_start.index.tolist())
        },
        ends=_ends(episodes),
        shared_goals=tuple(sorted(shared, key=goal_order)),
        kinds={kind: total_of([goal.goal for goal in goals if goal.kind is kind]) for kind in kinds}
        if len(kinds) > 1
        else {},
    )


def _cells(episodes: EpisodeColumns) -> CellCounts:
    counted = episodes[episodes.state.of(COUNTED)]
    return CellCounts.of(counted.goal.numbers, counted.start, counted.episode, counted.success)


def _of_start(start: int, episodes: EpisodeColumns, planned: int, cells: CellCounts) -> Summary:
    if start > 0:
        return _summary(episodes, planned, cells.outcomes(cells.starts == start, by_goal=True))
    return _summary(episodes, planned, _cells(episodes).outcomes(by_goal=True))  # each episode is a cell


def _summary(episodes: EpisodeColumns, planned: int, outcomes: Outcomes) -> Summary:
    """Return the statistics of episodes of any state; `outcomes` covers the counted ones."""
    counted = episodes[episodes.state.of(COUNTED)]
    spl, soft_spl, sct = _known(counted.spl), _known(counted.soft_spl), _known(counted.sct)
    progress, distance_m = _known(counted.progress), _known(counted.distance_m)
    # The zeros of the failures alone would be misleading.
    if counted.success.any() and np.isnan(counted.spl[counted.success]).all():
        spl = spl[:0]
    if counted.success.any() and np.isnan(counted.sct[counted.success]).all():
        sct = sct[:0]
    return Summary(
        successes=int(counted.success.sum()),
        episodes=len(counted.success),
        planned=planned,
        void=int(episodes.state.of(VOID).sum()),
        unjudged=int(episodes.state.of(UNJUDGED).sum()),
        mean_actions=_mean(counted.actions),
        mean_actions_successful=_mean(counted.actions[counted.success]),
        spl=_mean(spl),
        soft_spl=_mean(soft_spl),
        spl_episodes=len(spl),
        soft_spl_episodes=len(soft_spl),
        progress=_mean(progress),
        progress_episodes=len(progress),
        sct=_mean(sct),
        sct_episodes=len(sct),
        mean_driving_s=_mean(_known(counted.duration_s)),
        mean_thinking_s=_mean(_known(counted.thinking_s)),
        median_distance_m=float(np.median(distance_m)) if len(distance_m) else math.nan,
        collisions=int(counted.end_reason.of(EndReason.COLLISION.value).sum()),
        step_limits=int(counted.end_reason.of(EndReason.STEP_LIMIT.value).sum()),
        time_limits=int(counted.end_reason.of(EndReason.TIME_LIMIT.value).sum()),
        path_limits=int(counted.end_reason.of(EndReason.PATH_LIMIT.value).sum()),
        trivial=int((_known(counted.shortest_m) < TRIVIAL_M).sum()),
        outcomes=outcomes,
    )


def _known(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values that are not NaN."""
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


def _mean(numbers: NDArray[Any]) -> float:
    """Return the mean, bit for bit independent of the order of the episodes."""
    return float(np.sort(numbers).mean()) if len(numbers) else math.nan
