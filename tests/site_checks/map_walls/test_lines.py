"""Walls proposed in a map."""

import math

import numpy as np
import pytest
import shapely

from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, PlanGrid
from vsnbench.site_checks.map_walls.lines import propose_walls
from vsnbench.values.pose import Pose


def drawn(*shapes: shapely.Polygon, origin: Pose | None = None) -> PlanGrid:
    """Draw shapes, metres from the grid's corner, into 8 m x 6 m of cells of 5 cm."""
    x_m, y_m = np.meshgrid((np.arange(160) + 0.5) * 0.05, (np.arange(120) + 0.5) * 0.05)
    inside = shapely.contains_xy(shapely.union_all(list(shapes)), x_m, y_m)
    return PlanGrid(np.where(inside, OCCUPIED, FREE).astype(np.uint8), 0.05, origin or Pose(0.0, 0.0))


def wall(x0: float, y0: float, x1: float, y1: float, thick: float = 0.15) -> shapely.Polygon:
    return shapely.LineString([(x0, y0), (x1, y1)]).buffer(thick / 2, cap_style="flat")


WALLS = [(1, 1, 7, 1), (7, 1, 7, 5), (1, 1, 1, 5), (1, 5, 5, 5), (5, 5, 7, 3)]
"""The last wall is diagonal."""


def covered(grid: PlanGrid, walls: list[tuple[float, ...]]) -> float:
    near = shapely.union_all([shapely.LineString([each.start, each.end]).buffer(0.06) for each in propose_walls(grid)])
    lines = [shapely.LineString([(x0, y0), (x1, y1)]) for x0, y0, x1, y1 in walls]
    return sum(line.intersection(near).length for line in lines) / sum(line.length for line in lines)


def test_walls_straight_and_diagonal_are_proposed_where_they_are() -> None:
    assert covered(drawn(*(wall(*each) for each in WALLS)), list(WALLS)) > 0.9


def test_a_cupboard_is_not_a_wall() -> None:
    grid = drawn(wall(1, 1, 7, 1), shapely.box(3, 3, 4.2, 4.0))
    (line,) = propose_walls(grid)
    assert line.thickness_m == pytest.approx(0.15, abs=0.06)
    assert line.length_m == pytest.approx(6.0, abs=0.1)


def test_a_wall_with_a_shelf_against_it_is_proposed_and_the_doorway_beside_it() -> None:
    walls = [wall(2, 1, 2, 3), wall(2, 3.7, 2, 5), wall(2, 1, 7, 1)]
    grid = drawn(*walls, shapely.box(1.45, 1.0, 1.95, 2.55))
    assert covered(grid, [(2, 1, 2, 3)]) > 0.9
    (line,) = [each for each in propose_walls(grid) if each.doorways]
    assert sorted([line.start[1], line.end[1]]) == pytest.approx([1.0, 5.0], abs=0.15)


def test_cupboards_along_a_wall_take_nothing_from_it() -> None:
    """In a SLAM map a wall is one cell thick, and sides of objects in front of it cross it."""
    cupboards = [shapely.box(x, 4.25, x + 0.35, 5.0) for x in (1.6, 2.2, 2.8, 3.4, 4.0, 4.6, 5.2, 5.8)]
    uprights = [wall(x, 0.5, x, 5.0) for x in (1.0, 7.0)]
    grid = drawn(wall(1, 5.025, 7, 5.025, 0.05), *uprights, *cupboards)
    assert covered(grid, [(1, 5.025, 7, 5.025)]) > 0.95


def test_proposals_lie_in_the_sites_frame() -> None:
    (line,) = propose_walls(drawn(wall(1, 1, 7, 1), origin=Pose(10.0, 20.0, math.pi / 2)))
    ends = sorted([line.start, line.end], key=lambda end: end[1])
    assert ends[0] == pytest.approx((9.0, 21.0), abs=0.08)
    assert ends[1] == pytest.approx((9.0, 27.0), abs=0.08)


def test_an_empty_map_proposes_nothing() -> None:
    assert propose_walls(drawn()) == []


def test_walls_in_one_line_are_one_with_the_doorway_between_them() -> None:
    (line,) = propose_walls(drawn(wall(1, 2, 4, 2), wall(4.8, 2, 6, 2)))
    assert sorted([line.start[0], line.end[0]]) == pytest.approx([1.0, 6.0], abs=0.08)
    ((one, other),) = line.doorways
    assert sorted([one[0], other[0]]) == pytest.approx([4.0, 4.8], abs=0.06)
    assert one[1] == pytest.approx(2.0, abs=0.03)


def test_a_stub_beyond_a_doorway_belongs_to_the_wall_and_is_none_alone() -> None:
    (line,) = propose_walls(drawn(wall(1, 1, 4, 3), wall(4.7, 3.4667, 4.95, 3.6333)))
    assert len(line.doorways) == 1
    assert line.length_m == pytest.approx(math.hypot(3.95, 2.6333), abs=0.15)
    assert propose_walls(drawn(wall(4.7, 3, 5, 3))) == []


def test_a_doorway_that_noise_narrowed_by_a_cell_on_both_sides_is_one() -> None:
    (line,) = propose_walls(drawn(wall(1, 2, 4, 2), wall(4.55, 2, 6, 2)))
    assert len(line.doorways) == 1


def test_a_slightly_slanted_wall_is_straightened_to_be_collinear_with_the_rest() -> None:
    rest = [wall(1.98, 3.7, 1.98, 4.3, 0.1), wall(2, 1, 7, 1), wall(2, 4.3, 7, 4.3)]
    lines = propose_walls(drawn(wall(1.98, 1, 2.06, 3.0, 0.1), *rest))
    assert [len(line.doorways) for line in lines] == [0, 0, 1]


def test_two_doorways_lie_on_one_wall() -> None:
    (line,) = propose_walls(drawn(wall(1, 2, 3, 2), wall(3.9, 2, 5, 2), wall(5.7, 2, 7, 2)))
    assert len(line.doorways) == 2


@pytest.mark.parametrize(
    "shapes",
    [
        [wall(1, 2, 3, 2), wall(4.6, 2, 7, 2)],
        [wall(1, 2, 3, 2), wall(3.3, 2, 7, 2)],
        [wall(1, 2, 3, 2), wall(3.8, 2.3, 7, 2.3)],
        [wall(1, 2, 3, 2), wall(3.8, 2, 7, 2), shapely.box(3.2, 1.7, 3.6, 2.6)],
    ],
    ids=["too wide", "too narrow", "not in one line", "something stands in it"],
)
def test_other_gaps_are_not_doorways(shapes: list[shapely.Polygon]) -> None:
    assert [line.doorways for line in propose_walls(drawn(*shapes))] == [(), ()]
