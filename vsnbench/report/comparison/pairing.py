"""Pairs the episodes of two conditions by cell.

Cells with episodes of both conditions are paired, with all their episodes. The other episodes are counted as left out.
All of it is known from the summaries. Within a cell, episodes of the same seed and repetition are also matched one to
one, to count the pairs in which only one condition succeeded; the test does not need these matches.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.summary import ConditionSummary, Group
from vsnbench.statistics.clustered import Cell, independent_difference
from vsnbench.statistics.multiple import simultaneous
from vsnbench.statistics.paired import PairedCell, PairedOutcomes, paired_interval
from vsnbench.statistics.rates import Interval, Proportion

if TYPE_CHECKING:
    from collections.abc import Collection

    import pandas as pd


@dataclass(frozen=True, slots=True)
class Pairing:
    """Shared cells of two conditions, with their outcomes."""

    outcomes: PairedOutcomes
    left_out: tuple[int, int]
    """Episodes of each condition in cells that only it has."""

    @property
    def proportions(self) -> tuple[Proportion, Proportion]:
        """Successes and episodes of each condition in the shared cells."""
        return self.outcomes.first.proportion, self.outcomes.second.proportion

    @property
    def starts(self) -> int:
        """Number of starting positions of the shared cells."""
        return self.outcomes.first.clusters

    @property
    def single(self) -> bool:
        """Whether each starting position has one episode of each, so that the test is McNemar's exact test."""
        return self.outcomes.first.independent and self.outcomes.second.independent


def same_places(first: Condition, second: Condition) -> bool:
    """Whether both conditions use the same site, seen in its scan or not, and so the same starting positions."""
    return bool(first.places_sha256) and first.places_sha256 == second.places_sha256


def pair(first: ConditionSummary, second: ConditionSummary, goals: "Collection[str]") -> Pairing | None:
    """Pair the counted episodes of two conditions on these goals; None without shared cells."""
    if not same_places(first.condition, second.condition):
        return None
    sides = [placed_cells(summary, goals) for summary in (first, second)]
    shared = sorted(sides[0].keys() & sides[1].keys())
    if not shared:
        return None
    inside = [sum(side[place].trials for place in shared) for side in sides]
    everything = [sum(goal.episodes for goal in summary.goals if goal.goal in goals) for summary in (first, second)]
    return Pairing(
        outcomes=PairedOutcomes(tuple(PairedCell(sides[0][place], sides[1][place]) for place in shared)),
        left_out=(everything[0] - inside[0], everything[1] - inside[1]),
    )


def rate_difference(pairing: Pairing | None, first: Group, second: Group) -> float:
    """Return the first success rate minus the second; over shared cells the mean over them."""
    return pairing.outcomes.difference if pairing else first.success_rate - second.success_rate


def difference_interval(pairing: Pairing | None, first: Group, second: Group, questions: int = 1) -> Interval:
    """Return the interval of that difference; those of all questions hold together with 95 %."""
    confidence = simultaneous(questions)
    if pairing:
        return paired_interval(pairing.outcomes, confidence)
    return independent_difference(first.outcomes, second.outcomes, confidence)


def placed_cells(summary: ConditionSummary, goals: "Collection[str]") -> dict[tuple[str, int], Cell]:
    """Return the cells with a known starting position, by goal and starting position."""
    return {
        (str(group.goal), cell.cluster): cell
        for group in summary.goals
        if group.goal in goals
        for cell in group.outcomes.cells
        if cell.cluster > 0
    }


@dataclass(frozen=True, slots=True)
class Matches:
    """Pairs of episodes in one cell with the same seed and repetition."""

    pairs: int
    only_first: int
    """Pairs in which only the first succeeded."""
    only_second: int


MATCHED_BY = ["goal", "start", "seed", "repetition"]


def seeded(rows: "pd.DataFrame", condition: Condition, measured: "Collection[str]" = ("success",)) -> "pd.DataFrame":
    """Return the columns for matching and some measured ones, one row per seed and repetition of a cell."""
    seeds = dict(zip(condition.campaigns, condition.seeds, strict=True))
    placed = rows[rows["start"] > 0]  # 0: an import without starting positions
    keyed = placed.assign(seed=placed["campaign"].map(seeds))[[*MATCHED_BY, *measured]]
    return keyed.drop_duplicates(MATCHED_BY)


def match(first: "pd.DataFrame", second: "pd.DataFrame", goals: "Collection[str]") -> Matches:
    """Match the `seeded` episodes of two conditions on these goals."""
    sides = [rows[rows["goal"].isin(list(goals))] for rows in (first, second)]
    pairs = sides[0].merge(sides[1], on=MATCHED_BY, suffixes=("_first", "_second"))
    a, b = pairs["success_first"].astype(bool), pairs["success_second"].astype(bool)
    return Matches(len(pairs), int((a & ~b).sum()), int((~a & b).sum()))
