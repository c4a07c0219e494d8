"""What a reviewer asks of success rates: would they hold under other rules, from farther off, by seed, over time?

Everything is counted anew from the episodes in the record; nothing is driven again.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import TRIVIAL_M
from vsnbench.report.record import Record, goal_order
from vsnbench.report.summary import ConditionSummary, outcomes_of
from vsnbench.statistics.clustered import Outcomes, independent_difference, rate_interval
from vsnbench.statistics.drift import Trend, trend
from vsnbench.statistics.rates import UNKNOWN, Interval, Proportion

if TYPE_CHECKING:
    import pandas as pd

THRESHOLDS = (0.5, 0.75, 1.25, 1.5)
"""Of the success distance that was in force."""
CAPS = (1 / 3, 2 / 3)
"""Of the cap on actions that was in force."""
DISTANCES_M = (0.0, TRIVIAL_M, 2.0, 4.0, 6.0, math.inf)
"""Bounds of the groups by shortest path; below the second a trial is trivial."""


@dataclass(frozen=True, slots=True)
class Recount:
    """The success rate counted in another way, or of a part of the episodes."""

    what: str
    outcomes: Outcomes
    bound: Proportion | None = None
    """In place of the outcomes where trials that are missing are counted in."""

    @property
    def proportion(self) -> Proportion:
        """Successes of episodes."""
        return self.bound or self.outcomes.proportion

    @property
    def interval(self) -> Interval | None:
        """95 % interval; None for a bound, which is no estimate."""
        return None if self.bound else rate_interval(self.outcomes)


def sensitivity(record: Record, one: ConditionSummary) -> tuple[Recount, ...]:
    """Return the success rate as judged, then under other rules, each where the record supports it."""
    rows = record.counted(one.condition)
    if rows.empty:
        return ()
    return (Recount("as judged", one.total.outcomes), *_recounts(rows, one))


def _recounts(rows: "pd.DataFrame", one: ConditionSummary) -> Iterator[Recount]:
    trivial = rows["shortest_m"] < TRIVIAL_M
    if trivial.any() and not trivial.all():
        yield Recount("without trivial trials", outcomes_of(rows[~trivial]))
    within_m, cap = one.condition.success_distance_m, one.condition.max_actions
    stopped = rows["end_reason"] == EndReason.STOP.value
    if within_m and stopped.any() and rows.loc[stopped, "distance_m"].notna().all():
        # Near enough and yet no success: a person knew better. No threshold changes that, nor a wall between.
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
    missing = one.total.planned - one.total.episodes
    if missing > 0:
        total = one.total
        yield Recount("missing trials all fail", total.outcomes, Proportion(total.successes, total.planned))
        most = total.successes + missing
        yield Recount("missing trials all succeed", total.outcomes, Proportion(most, total.planned))


def by_distance(record: Record, one: ConditionSummary) -> tuple[Recount, ...]:
    """Return the success rate by the length of the shortest path, the trivial ones first; empty where none is known."""
    rows = record.counted(one.condition)
    groups = []
    for low, high in itertools.pairwise(DISTANCES_M):
        mine = rows[(rows["shortest_m"] >= low) & (rows["shortest_m"] < high)]
        if not mine.empty:
            upper = f"to {high:g} m" if math.isfinite(high) else "m and more"
            trivial = ", trivial" if high <= TRIVIAL_M else ""
            groups.append(Recount(f"{low:g} {upper}{trivial}", outcomes_of(mine)))
    return tuple(groups)


def by_seed(record: Record, one: ConditionSummary) -> tuple[Recount, ...]:
    """Return the success rate under each seed; empty where there is only one."""
    seeds = dict(zip(one.condition.campaigns, one.condition.seeds, strict=False))
    if len(set(seeds.values())) < 2:
        return ()
    rows = record.counted(one.condition)
    own = rows["campaign"].map(seeds)
    return tuple(Recount(str(seed), outcomes_of(mine)) for seed, mine in rows.groupby(own))


def spread_between(groups: tuple[Recount, ...]) -> float:
    """Return the standard deviation of the groups' success rates, as a share; NaN for fewer than two."""
    import statistics

    rates = [each.proportion.rate for each in groups if each.proportion.trials]
    return statistics.stdev(rates) if len(rates) > 1 else math.nan


FEWEST_IN_TIME = 12
"""With fewer episodes nothing is said of time."""


@dataclass(frozen=True, slots=True)
class Drift:
    """Success early and late: batteries run down, floors get worn, daylight goes, people learn."""

    over: str
    """`a session`, or `all sessions`."""
    thirds: tuple[Recount, ...]
    difference: float
    """The success rate of the last third less that of the first."""
    interval: Interval
    """95 %, of the difference."""
    trend: Trend
    """The exact test, goal for goal (and session for session)."""


def drift(record: Record, one: ConditionSummary, *, whole: bool = False) -> Drift | None:
    """Return how success changed with time; None with fewer than 12 episodes, or over one session alone.

    A session is one operator's with the robot, or, where nobody wrote that down, one process's. Each episode is
    compared with those of its goal (and session) alone, so that running one goal after another is no drift.

    Args:
        record: where the episodes are.
        one: of which condition.
        whole: over all sessions, from the first trial to the last; else from the beginning of each session to its end.
    """
    rows = record.counted(one.condition).sort_values("started_at")
    session = rows["session"].where(rows["session"] > 0, -rows["process"])
    if len(rows) < FEWEST_IN_TIME or (whole and session.nunique() < 2):
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
    """Successes of episodes by starting position and goal; what was not tried is absent."""

    goals: tuple[str, ...]
    starts: tuple[int, ...]
    cells: dict[tuple[str, int], Proportion]


def grid(one: ConditionSummary) -> Grid:
    """Return every cell of a condition; starting positions that are not known are left out."""
    cells = {
        (goal.goal, cell.cluster): Proportion(cell.successes, cell.trials)
        for goal in one.goals
        for cell in goal.summary.outcomes.cells
        if cell.cluster > 0
    }
    goals = {goal for goal, _ in cells}
    return Grid(tuple(sorted(goals, key=goal_order)), tuple(sorted({start for _, start in cells})), cells)
