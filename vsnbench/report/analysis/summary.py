"""Groups of episodes that a report has statistics of: by goal and starting position, and in total.

Void episodes are never included in the rates; every group has the number of planned trials.
"""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from vsnbench.report.analysis.cell_counts import CellCounts
from vsnbench.report.analysis.comparability import shared_goals, shortcoming
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.episodes_frame import Codes, EpisodeColumns, ReportData, goal_order
from vsnbench.results.goals import RecordedGoal
from vsnbench.results.reading.read_model import COUNTED
from vsnbench.statistics.clustered import Outcomes, rate_interval
from vsnbench.statistics.rates import Interval, Proportion
from vsnbench.values.goal import GoalKind


@dataclass(frozen=True, eq=False)
class Group:
    """Episodes of a condition, or of one goal or starting position of it; a row of a table (`tables/success.py`)."""

    outcomes: Outcomes
    """Outcomes of the counted episodes by cell; clusters are starting positions."""
    planned: int
    """Planned trials."""
    attempts: EpisodeColumns | None = None
    """Episodes of any state; None if only the outcomes are known, as of published results."""
    goal: str | None = None
    kind: GoalKind | None = None
    start: int | None = None
    """0 for an import without starting positions."""
    success_distance_m: float | None = None
    """Distance to the goal below which STOP is a success; None if the protocol has none."""
    published_actions: float = math.nan
    """Mean number of actions that a publication states."""

    @cached_property
    def counted(self) -> EpisodeColumns | None:
        """The counted episodes, one per trial; None like `attempts`."""
        return None if self.attempts is None else self.attempts[self.attempts.state.of(COUNTED)]

    @cached_property
    def proportion(self) -> Proportion:
        """Successes and episodes."""
        return self.outcomes.proportion

    @property
    def successes(self) -> int:
        """Number of successes."""
        return self.proportion.successes

    @property
    def episodes(self) -> int:
        """Number of counted episodes."""
        return self.proportion.trials

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

    @property
    def title(self) -> str:
        """The goal, with its kind if it is not a category."""
        return goal_title(self.goal or "", self.kind or GoalKind.CATEGORY)


def sum_of(groups: Iterable[Group]) -> Group:
    """Return several groups as one, with what rates need."""
    members = list(groups)
    cells = tuple(cell for group in members for cell in group.outcomes.cells)
    return Group(Outcomes(cells), sum(group.planned for group in members))


def goal_title(goal: str, kind: GoalKind) -> str:
    """Return a goal's name for tables, with its kind if it is not a category."""
    return goal if kind is GoalKind.CATEGORY else f"{goal} ({kind})"


@dataclass(frozen=True, slots=True)
class ConditionSummary:
    """Groups of the episodes of one condition."""

    condition: Condition
    goals: tuple[Group, ...]
    total: Group
    shared: Group | None
    """Total over `shared_goals`; None if it equals the total."""
    starts: tuple[Group, ...] = ()
    """By starting position, over all goals."""
    shared_goals: tuple[str, ...] = ()
    """Goals shared with comparable conditions (`comparability.shared_goals`), in the order of the tables."""
    kinds: tuple[Group, ...] = ()
    """Totals by kind of goal; empty if all goals are of one kind."""

    def over(self, goals: Collection[str]) -> Group:
        """Return the sum over some goals, with what rates need."""
        return sum_of(group for group in self.goals if group.goal in goals)

    @property
    def own_goals(self) -> tuple[str, ...]:
        """Names of the goals, in the order of the tables."""
        return tuple(str(group.goal) for group in self.goals)

    @property
    def shortcoming(self) -> str:
        """Why the data do not suffice for a comparison, or an empty string."""
        return shortcoming(self.total.episodes, self.total.planned)

    @property
    def is_competitor(self) -> bool:
        """Whether the condition can be compared: a model without the site file, and enough completed trials."""
        return not self.condition.not_competing and not self.shortcoming

    @property
    def never_succeeding(self) -> tuple[int, ...]:
        """Starting positions with episodes but without success."""
        return tuple(group.start or 0 for group in self.starts if group.episodes and not group.successes)


@dataclass(frozen=True, slots=True)
class ReportResults:
    """All conditions of a report."""

    conditions: tuple[ConditionSummary, ...]

    @property
    def episodes(self) -> int:
        """Counted episodes over all conditions."""
        return sum(summary.total.episodes for summary in self.conditions)


def summarise(record: ReportData) -> ReportResults:
    """Compute the statistics of all conditions."""
    everything = record.columns
    episodes, none = dict(everything.by(everything.condition)), everything[:0]
    planned: dict[int, dict[tuple[str, int], int]] = {condition.number: {} for condition in record.conditions}
    for (number, goal, start), trials in record.planned.items():
        planned[number][goal, start] = trials
    shared = shared_goals(
        record.conditions,
        asked={number: {goal for goal, _ in trials} for number, trials in planned.items()},
        done={
            number: (int(episodes.get(number, none).state.of(COUNTED).sum()), sum(trials.values()))
            for number, trials in planned.items()
        },
    )
    numbered = [(condition.number, condition) for condition in record.conditions]
    return ReportResults(
        tuple(
            _condition(condition, episodes.get(number, none), planned[number], shared[number], record.goals)
            for number, condition in numbered
        )
    )


def _condition(
    condition: Condition,
    episodes: EpisodeColumns,
    planned: Mapping[tuple[str, int], int],
    shared: set[str],
    definitions: Mapping[str, RecordedGoal],
) -> ConditionSummary:
    names, none = episodes.goal.names, episodes[:0]
    cells = _cells(episodes)
    by_goal = {names[code]: mine for code, mine in episodes.by(episodes.goal.numbers)}
    by_start = dict(episodes.by(episodes.start))
    trials_by_goal: Counter[str] = Counter()
    trials_by_start: Counter[int] = Counter()
    for (goal, start), trials in planned.items():
        trials_by_goal[goal] += trials
        trials_by_start[start] += trials

    def kind_of(goal: str) -> GoalKind:
        return definitions[goal].kind if goal in definitions else GoalKind.CATEGORY

    def group(outcomes: Outcomes, planned: int, attempts: EpisodeColumns, **identity: Any) -> Group:
        within_m = condition.success_distance_m
        return Group(outcomes, planned, attempts, success_distance_m=within_m, **identity)

    def on(*goals: str) -> Outcomes:
        return cells.outcomes(Codes(cells.goals, names).of(*goals))

    goals = tuple(
        group(on(goal), trials_by_goal[goal], by_goal.get(goal, none), goal=goal, kind=kind_of(goal))
        for goal in sorted(trials_by_goal, key=goal_order)
    )
    kinds = [kind for kind in GoalKind if kind in {goal.kind for goal in goals}]

    def total_of(goals: Collection[str], kind: GoalKind | None = None) -> Group:
        trials = sum(trials_by_goal[goal] for goal in goals)
        return group(on(*goals), trials, episodes[episodes.goal.of(*goals)], kind=kind)

    common = None
    if shared and shared < {goal.goal for goal in goals}:
        common = total_of(shared)
    return ConditionSummary(
        condition=condition,
        goals=goals,
        total=group(cells.outcomes(), sum(planned.values()), episodes),
        shared=common,
        starts=tuple(
            group(
                _of_start(start, by_start.get(start, none), cells),
                trials_by_start[start],
                by_start.get(start, none),
                start=start,
            )
            for start in sorted(trials_by_start)
        ),
        shared_goals=tuple(sorted(shared, key=goal_order)),
        kinds=tuple(total_of([str(goal.goal) for goal in goals if goal.kind is kind], kind) for kind in kinds)
        if len(kinds) > 1
        else (),
    )


def _cells(episodes: EpisodeColumns) -> CellCounts:
    counted = episodes[episodes.state.of(COUNTED)]
    return CellCounts.of(counted.goal.numbers, counted.start, counted.episode, counted.success)


def _of_start(start: int, episodes: EpisodeColumns, cells: CellCounts) -> Outcomes:
    if start > 0:
        return cells.outcomes(cells.starts == start, by_goal=True)
    return _cells(episodes).outcomes(by_goal=True)  # each episode is a cell
