"""Which episodes of two conditions can be laid beside each other: cell by cell, and nothing is dropped without a word.

Cells that both were tried in are paired, with all their episodes; what lies in cells that only one was tried in is
counted as left out. All of it is known from the summaries. Within a cell, episodes of the same seed and repetition can
be matched one to one as well, for McNemar's table; the primary test needs no such match.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.report.conditions import Condition
from vsnbench.report.summary import ConditionSummary
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.paired import PairedCell, PairedOutcomes
from vsnbench.statistics.permutation import Stratum
from vsnbench.statistics.rates import Proportion

if TYPE_CHECKING:
    from collections.abc import Collection

    import pandas as pd


@dataclass(frozen=True, slots=True)
class Pairing:
    """The cells that two conditions share, and what of each is in them."""

    outcomes: PairedOutcomes
    left_out: tuple[int, int]
    """Episodes of the first and of the second in cells that the other was not tried in."""

    @property
    def proportions(self) -> tuple[Proportion, Proportion]:
        """Successes of episodes of the first and of the second, in the shared cells."""
        return self.outcomes.first.proportion, self.outcomes.second.proportion

    @property
    def starts(self) -> int:
        """Starting positions of the shared cells."""
        return self.outcomes.first.clusters

    @property
    def single(self) -> bool:
        """Whether each starting position holds one episode of each: flipping signs is McNemar's exact test then."""
        return self.outcomes.first.independent and self.outcomes.second.independent

    def strata(self) -> list[Stratum]:
        """Return the outcomes by starting position."""
        sums: dict[int, list[int]] = {}
        for cell in self.outcomes.cells:
            counts = sums.setdefault(cell.first.cluster, [0, 0, 0, 0])
            for place, one in ((0, cell.first), (2, cell.second)):
                counts[place] += one.successes
                counts[place + 1] += one.trials
        return [Stratum(Proportion(a, b), Proportion(c, d)) for a, b, c, d in sums.values()]


def same_places(first: Condition, second: Condition) -> bool:
    """Whether the starting positions of both are the same places."""
    return bool(first.site_sha256) and first.site_sha256 == second.site_sha256


def pair(first: ConditionSummary, second: ConditionSummary, goals: "Collection[str]") -> Pairing | None:
    """Pair two conditions' episodes that count, on these goals; None where they share no cell."""
    if not same_places(first.condition, second.condition):
        return None
    sides = [_cells(one, goals) for one in (first, second)]
    shared = sorted(sides[0].keys() & sides[1].keys())
    if not shared:
        return None
    inside = [sum(side[place].trials for place in shared) for side in sides]
    everything = [sum(each.summary.episodes for each in one.goals if each.goal in goals) for one in (first, second)]
    return Pairing(
        outcomes=PairedOutcomes(tuple(PairedCell(sides[0][place], sides[1][place]) for place in shared)),
        left_out=(everything[0] - inside[0], everything[1] - inside[1]),
    )


def _cells(one: ConditionSummary, goals: "Collection[str]") -> dict[tuple[str, int], Cell]:
    """Return the cells by goal and starting position, but for positions that are not known."""
    chosen = (each for each in one.goals if each.goal in goals)
    return {
        (each.goal, cell.cluster): cell for each in chosen for cell in each.summary.outcomes.cells if cell.cluster > 0
    }


@dataclass(frozen=True, slots=True)
class Matches:
    """Pairs of episodes of one cell with the same seed and repetition."""

    pairs: int
    only_first: int
    """Pairs in which only the first succeeded."""
    only_second: int


_MATCHED_BY = ["goal", "start", "seed", "repetition"]


def seeded(rows: "pd.DataFrame", condition: Condition) -> "pd.DataFrame":
    """Return what episodes of a condition can be matched by, and their success: one a seed and repetition of a cell."""
    seeds = dict(zip(condition.campaigns, condition.seeds, strict=True))
    placed = rows[rows["start"] > 0]  # 0 is no place: an import did not say which
    keyed = placed.assign(seed=placed["campaign"].map(seeds))[[*_MATCHED_BY, "success"]]
    return keyed.drop_duplicates(_MATCHED_BY)


def match(first: "pd.DataFrame", second: "pd.DataFrame", goals: "Collection[str]") -> Matches:
    """Match the `seeded` episodes of two conditions, on these goals."""
    sides = [rows[rows["goal"].isin(list(goals))] for rows in (first, second)]
    pairs = sides[0].merge(sides[1], on=_MATCHED_BY, suffixes=("_first", "_second"))
    a, b = pairs["success_first"].astype(bool), pairs["success_second"].astype(bool)
    return Matches(len(pairs), int((a & ~b).sum()), int((~a & b).sum()))
