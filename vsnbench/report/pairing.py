"""Which episodes of two conditions can be laid beside each other: cell by cell, and nothing is dropped without a word.

Cells that both were tried in are paired, with all their episodes; what lies in cells that only one was tried in is
counted as left out. Within a cell, episodes of the same seed and repetition are matched one to one as well, for
McNemar's table; the primary test needs no such match.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsnbench.report.conditions import Condition
from vsnbench.report.record import Record
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.paired import PairedCell, PairedOutcomes
from vsnbench.statistics.permutation import Stratum
from vsnbench.statistics.rates import Proportion

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd


@dataclass(frozen=True, slots=True)
class Pairing:
    """The cells that two conditions share, and what of each is in them."""

    outcomes: PairedOutcomes
    left_out: tuple[int, int]
    """Episodes of the first and of the second in cells that the other was not tried in."""
    matched: int
    """Pairs of episodes with the same seed and repetition."""
    only_first: int
    """Matched pairs in which only the first succeeded."""
    only_second: int

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


def pair(record: Record, first: Condition, second: Condition, goals: "Sequence[str]") -> Pairing | None:
    """Pair two conditions' episodes that count, on these goals; None where they share no cell."""
    if not same_places(first, second):
        return None
    everything = [counted_on(record, one, goals) for one in (first, second)]
    sides = [rows[rows["start"] > 0] for rows in everything]  # 0 is no place: an import did not say which
    cells = [_cells(rows) for rows in sides]
    shared = [place for place in cells[0] if place in cells[1]]
    if not shared:
        return None
    paired = [PairedCell(cells[0][place], cells[1][place]) for place in shared]
    inside = [sum(side[place].trials for place in shared) for side in cells]
    seeds = {n: seed for one in (first, second) for n, seed in zip(one.campaigns, one.seeds, strict=True)}
    matched, only_first, only_second = _matched(sides, seeds)
    return Pairing(
        outcomes=PairedOutcomes(tuple(paired)),
        left_out=(len(everything[0]) - inside[0], len(everything[1]) - inside[1]),
        matched=matched,
        only_first=only_first,
        only_second=only_second,
    )


def counted_on(record: Record, condition: Condition, goals: "Iterable[str]") -> "pd.DataFrame":
    """Return the episodes of a condition that count, on these goals; goals as plain text."""
    rows = record.counted(condition)
    return rows[rows["goal"].isin(list(goals))].astype({"goal": str})


def _cells(rows: "pd.DataFrame") -> dict[tuple[str, int], Cell]:
    counts = rows.groupby(["goal", "start"])["success"].agg(["sum", "count"]).reset_index()
    listed = counts[["goal", "start", "sum", "count"]].to_numpy(object).tolist()
    return {(goal, start): Cell(start, int(successes), trials) for goal, start, successes, trials in listed}


def _matched(sides: "list[pd.DataFrame]", seeds: dict[int, int]) -> tuple[int, int, int]:
    on = ["goal", "start", "seed", "repetition"]
    keyed = [rows.assign(seed=rows["campaign"].map(seeds))[[*on, "success"]] for rows in sides]
    pairs = keyed[0].drop_duplicates(on).merge(keyed[1].drop_duplicates(on), on=on, suffixes=("_first", "_second"))
    a, b = pairs["success_first"].astype(bool), pairs["success_second"].astype(bool)
    return len(pairs), int((a & ~b).sum()), int((~a & b).sum())
