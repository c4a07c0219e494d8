"""Cell counts in arrays equal counts episode by episode."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.report.analysis.cell_counts import CellCounts
from vsnbench.statistics.clustered import Cell

EPISODES = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 4), st.booleans()), max_size=60)


def counted(episodes: list[tuple[int, int, bool]]) -> CellCounts:
    rows = np.array([(goal, start, won) for goal, start, won in episodes], np.int64).reshape(-1, 3)
    numbers = np.arange(1, len(rows) + 1)
    return CellCounts.of(rows[:, 0].astype(np.int8), rows[:, 1], numbers, rows[:, 2].astype(bool))


def one_by_one(episodes: list[tuple[int, int, bool]]) -> dict[tuple[int, int], tuple[int, int]]:
    cells: dict[tuple[int, int], tuple[int, int]] = {}
    for number, (goal, start, won) in enumerate(episodes, start=1):
        place = (goal, start or -number)
        successes, trials = cells.get(place, (0, 0))
        cells[place] = (successes + won, trials + 1)
    return dict(sorted(cells.items()))


@given(EPISODES)
def test_cells_are_those_of_counting_one_by_one_in_the_order_of_goals_and_positions(
    episodes: list[tuple[int, int, bool]],
) -> None:
    expected = one_by_one(episodes)
    assert counted(episodes).outcomes().cells == tuple(Cell(place[1], *counts) for place, counts in expected.items())


@given(EPISODES, st.integers(1, 4))
def test_of_one_position_the_goals_are_the_clusters(episodes: list[tuple[int, int, bool]], start: int) -> None:
    cells = counted(episodes)
    expected = {place: counts for place, counts in one_by_one(episodes).items() if place[1] == start}
    outcomes = cells.outcomes(cells.starts == start, by_goal=True)
    assert outcomes.cells == tuple(Cell(place[0], *counts) for place, counts in expected.items())


def test_episodes_whose_position_is_not_known_share_no_cell() -> None:
    outcomes = counted([(0, 0, True), (0, 0, False), (0, 2, True), (0, 2, True)]).outcomes()
    assert sorted((cell.cluster, cell.successes, cell.trials) for cell in outcomes.cells) == [
        (-2, 0, 1),
        (-1, 1, 1),
        (2, 2, 2),
    ]
