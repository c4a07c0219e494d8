"""Successes and trials by cell: goal and starting position."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from vsnbench.report.analysis.episodes_frame import Integers, Rows
from vsnbench.statistics.clustered import Cell, Outcomes

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, eq=False)
class CellCounts:
    """Successes and trials by cell, ordered by goal and starting position."""

    goals: Integers
    """Codes of the goals."""
    starts: Integers
    """An episode with unknown position is a cell of its own, with its negative number."""
    successes: Integers
    trials: Integers

    @classmethod
    def of(cls, goals: Integers, starts: Integers, episodes: Integers, success: NDArray[np.bool_]) -> Self:
        """Count the outcomes of counted episodes.

        Args:
            goals: (episodes,) code of the goal.
            starts: (episodes,) number of the starting position; 0 if unknown.
            episodes: (episodes,) number of the episode.
            success: (episodes,) whether it succeeded.
        """
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

    def outcomes(self, cells: Rows = slice(None), *, by_goal: bool = False) -> Outcomes:
        """Return the outcomes of some cells.

        Args:
            cells: indices of the cells; all by default.
            by_goal: use goals as clusters, for a single starting position; otherwise starting positions.
        """
        clusters = self.goals if by_goal else self.starts
        listed = (column[cells].tolist() for column in (clusters, self.successes, self.trials))
        return Outcomes(tuple(Cell(*row) for row in zip(*listed, strict=True)))


def outcomes_of(episodes: "pd.DataFrame") -> Outcomes:
    """Return the outcomes by cell of counted rows of `ReportData.episodes`; clusters are starting positions."""
    goals = episodes["goal"].cat.codes.to_numpy()
    starts, numbers = (episodes[name].to_numpy(np.int64) for name in ("start", "episode"))
    return CellCounts.of(goals, starts, numbers, episodes["success"].to_numpy(bool)).outcomes()
