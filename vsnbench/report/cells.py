"""What summaries count, as arrays: columns of the episodes, and their cells (goal x starting position) counted once.

In numpy: a large report makes hundreds of summaries, and pandas takes longer to begin than to count.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from vsnbench.statistics.clustered import Cell, Outcomes

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    Integers: TypeAlias = NDArray[np.integer[Any]]
    Floats: TypeAlias = NDArray[np.float64]
    Rows: TypeAlias = NDArray[np.bool_] | Integers | slice


@dataclass(frozen=True, slots=True, eq=False)
class Codes:
    """A categorical column as small numbers."""

    numbers: "Integers"
    names: Sequence[str]

    def of(self, *names: str) -> "NDArray[np.bool_]":
        """Return which rows have one of these values."""
        import numpy as np

        found = np.zeros(len(self.numbers), bool)
        for name in names:
            if name in self.names:
                found |= self.numbers == self.names.index(name)
        return found

    def __getitem__(self, rows: "Rows") -> "Codes":
        return Codes(self.numbers[rows], self.names)


@dataclass(frozen=True, slots=True, eq=False)
class EpisodeColumns:
    """Columns of `Record.episodes`, an entry an episode; units are those of the names."""

    episode: "Integers"
    condition: "Integers"
    goal: Codes
    start: "Integers"
    state: Codes
    end_reason: Codes
    success: "NDArray[np.bool_]"
    actions: "Integers"
    spl: "Floats"
    soft_spl: "Floats"
    distance_m: "Floats"
    shortest_m: "Floats"

    @classmethod
    def of(cls, episodes: "pd.DataFrame") -> Self:
        """Return the columns of rows of `Record.episodes`."""

        def column(name: str) -> Any:
            values = episodes[name]
            if name in ("goal", "state", "end_reason"):
                return Codes(values.cat.codes.to_numpy(), list(values.cat.categories))
            return values.to_numpy()

        return cls(*(column(name) for name in cls.__slots__))

    def __getitem__(self, rows: "Rows") -> Self:
        return type(self)(*(getattr(self, name)[rows] for name in self.__slots__))

    def by(self, numbers: "Integers") -> "Iterator[tuple[int, EpisodeColumns]]":
        """Yield each number and its episodes, in the order of the rows.

        Args:
            numbers: (episodes,) what to group by.
        """
        import numpy as np

        order = np.argsort(numbers, kind="stable")
        values, begins = np.unique(numbers[order], return_index=True)
        for value, rows in zip(values.tolist(), np.split(order, begins[1:]), strict=False):
            yield value, self[rows]


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
