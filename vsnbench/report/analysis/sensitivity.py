"""Sensitivity analyses of success rates: other rules, shortest path, seed, drift; from the recorded episodes."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import stdev
from typing import TYPE_CHECKING

from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import TRIVIAL_M
from vsnbench.report.analysis.cell_counts import outcomes_of
from vsnbench.report.analysis.episodes_frame import ReportData, goal_order
from vsnbench.report.analysis.summary import ConditionSummary
from vsnbench.statistics.clustered import Outcomes, independent_difference, rate_interval
from vsnbench.statistics.drift import Trend, trend
from vsnbench.statistics.rates import UNKNOWN, Interval, Proportion

if TYPE_CHECKING:
    import pandas as pd

THRESHOLDS = (0.5, 0.75, 1.25, 1.5)
"""Multiples of the success distance."""
CAPS = (1 / 3, 2 / 3)
"""Multiples of the maximum number of actions."""
DISTANCES_M = (0.0, TRIVIAL_M, 2.0, 4.0, 6.0, math.inf)
"""Bounds of the groups by shortest path; trials below the second are trivial."""


@dataclass(frozen=True, slots=True)
class Recount:
    """A success rate under another rule, or of a part of the episodes."""

    label: str
    outcomes: Outcomes
    bound: Proportion | None = None
    """Replaces the outcomes if missing trials are included."""

    @property
    def proportion(self) -> Proportion:
        """Successes and episodes."""
        return self.bound or self.outcomes.proportion

    @property
    def interval(self) -> Interval | None:
        """95 % interval; None for a bound."""
        return None if self.bound else rate_interval(self.outcomes)


def sensitivity(record: ReportData, summary: ConditionSummary) -> tuple[Recount, ...]:
    """Return the success rate as judged and under other rules that the record supports."""
    rows = record.counted(summary.condition)
    if rows.empty:
        return ()
    return (Recount("as judged", summary.total.outcomes), *_recounts(rows, summary))


def _recounts(rows: "pd.DataFrame", summary: ConditionSummary) -> Iterator[Recount]:
    trivial = rows["shortest_m"] < TRIVIAL_M
    if trivial.any() and not trivial.all():
        yield Recount("without trivial trials", outcomes_of(rows[~trivial]))
    within_m, cap = summary.condition.success_distance_m, summary.condition.max_actions
    stopped = rows["end_reason"] == EndReason.STOP.value
    if within_m and stopped.any() and rows.loc[stopped, "distance_m"].notna().all():
        # A near STOP that failed was judged by an operator or had no line of sight: no threshold changes it.
        refused = ~rows["success"] & (rows["distance_m"] < within_m) | ~rows["goal_in_sight"]
        in_time = rows["actions"] < cap if cap else True
        for share in THRESHOLDS:
            near = stopped & ~refused & in_time & (rows["distance_m"] < share * within_m)
            yield Recount(f"success under {share * within_m:g} m", outcomes_of(rows.assign(success=near)))
    if cap:
        for share in CAPS:
            most = round(share * cap)
            in_time = rows["success"] & (rows["actions"] < most)
            yield Recount(f"at most {most} actions", outcomes_of(rows.assign(success=in_time)))
    missing = summary.total.planned - summary.total.episodes
    if missing > 0:
        total = summary.total
        yield Recount("missing trials all fail", total.outcomes, Proportion(total.successes, total.planned))
        most = total.successes + missing
        yield Recount("missing trials all succeed", total.outcomes, Proportion(most, total.planned))


def by_distance(record: ReportData, summary: ConditionSummary) -> tuple[Recount, ...]:
    """Return the success rate by shortest path length; empty if no length is known."""
    rows = record.counted(summary.condition)
    groups = []
    for low, high in itertools.pairwise(DISTANCES_M):
        mine = rows[(rows["shortest_m"] >= low) & (rows["shortest_m"] < high)]
        if not mine.empty:
            upper = f"to {high:g} m" if math.isfinite(high) else "m and more"
            trivial = ", trivial" if high <= TRIVIAL_M else ""
            groups.append(Recount(f"{low:g} {upper}{trivial}", outcomes_of(mine)))
    return tuple(groups)


def by_seed(record: ReportData, summary: ConditionSummary) -> tuple[Recount, ...]:
    """Return the success rate of each seed; empty with a single seed."""
    seeds = dict(zip(summary.condition.campaigns, summary.condition.seeds, strict=False))
    if len(set(seeds.values())) < 2:
        return ()
    rows = record.counted(summary.condition)
    own = rows["campaign"].map(seeds)
    return tuple(Recount(str(seed), outcomes_of(mine)) for seed, mine in rows.groupby(own))


def spread_between(groups: tuple[Recount, ...]) -> float:
    """Return the standard deviation of the groups' success rates; NaN for fewer than two."""
    rates = [recount.proportion.rate for recount in groups if recount.proportion.trials]
    return stdev(rates) if len(rates) > 1 else math.nan


MIN_DRIFT_EPISODES = 12
"""Smallest number of episodes for a drift analysis."""


@dataclass(frozen=True, slots=True)
class Drift:
    """Change of success with time, for example from batteries, wear, daylight or learning operators."""

    over: str
    """`a session`, or `all sessions`."""
    thirds: tuple[Recount, ...]
    difference: float
    """Success rate of the last third minus that of the first."""
    interval: Interval
    """95 % interval of the difference."""
    trend: Trend
    """Exact test, stratified by goal (and session)."""


def drift(record: ReportData, summary: ConditionSummary, *, whole: bool = False) -> Drift | None:
    """Return the change of success with time; None with fewer than 12 episodes or no second session.

    A session is an operator's session or, if none was recorded, a process. Each episode is compared only with episodes
    of the same goal (and session), so that running the goals one after another does not appear as drift.

    Args:
        record: the episodes.
        summary: the condition.
        whole: over all sessions, from the first trial to the last; otherwise within sessions.
    """
    rows = record.counted(summary.condition).sort_values("started_at")
    session = rows["session"].where(rows["session"] > 0, -rows["process"])
    if len(rows) < MIN_DRIFT_EPISODES or (whole and session.nunique() < 2):
        return None
    sessions = rows.groupby(session * (not whole))
    place = (sessions.cumcount() + 0.5) / sessions["episode"].transform("count")
    third = (place * 3).astype(int)
    names = ("first third", "second third", "last third")
    over = "all sessions" if whole else "a session"
    parts = {n: outcomes_of(rows[third == n]) for n in range(3) if (third == n).any()}
    ends = (parts[2], parts[0]) if 0 in parts and 2 in parts else None
    strata = rows.groupby([session * (not whole), "goal"], observed=True)["success"]
    return Drift(
        over,
        tuple(Recount(f"{names[n]} of {over}", mine) for n, mine in parts.items()),
        ends[0].proportion.rate - ends[1].proportion.rate if ends else math.nan,
        independent_difference(*ends) if ends else UNKNOWN,
        trend([mine.tolist() for _, mine in strata]),
    )


@dataclass(frozen=True, slots=True)
class Grid:
    """Successes and episodes by starting position and goal; cells without episodes are absent."""

    goals: tuple[str, ...]
    starts: tuple[int, ...]
    cells: dict[tuple[str, int], Proportion]


def grid(summary: ConditionSummary) -> Grid:
    """Return all cells of a condition with a known starting position."""
    cells = {
        (str(group.goal), cell.cluster): Proportion(round(cell.successes), cell.trials)
        for group in summary.goals
        for cell in group.outcomes.cells
        if cell.cluster > 0
    }
    goals = {goal for goal, _ in cells}
    return Grid(tuple(sorted(goals, key=goal_order)), tuple(sorted({start for _, start in cells})), cells)
