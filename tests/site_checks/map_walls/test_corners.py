"""Corners of proposed walls are straightened, and closed unless free cells are between them."""

import math

import numpy as np
import pytest

from vsnbench.site_checks.map_walls.corners import WallLine, main_direction, straightened, with_closed_corners
from vsnbench.site_checks.map_walls.grid import FREE, UNKNOWN, PlanGrid
from vsnbench.values.pose import Pose

UNSEEN = PlanGrid(np.full((120, 120), UNKNOWN, np.uint8), 0.05, Pose(-1.0, -1.0))
OPEN = PlanGrid(np.full((120, 120), FREE, np.uint8), 0.05, Pose(-1.0, -1.0))
LONG = WallLine((0.0, 0.0), (4.0, 0.0), 0.1)


def ends(line: WallLine) -> list[tuple[float, float]]:
    return [line.start, line.end]


@pytest.mark.parametrize("gap_m", [-0.3, 0.1, 0.7])
def test_walls_that_nearly_meet_do(gap_m: float) -> None:
    one, other = with_closed_corners([LONG, WallLine((4.2, gap_m), (4.2, 3.0), 0.1)], UNSEEN)
    assert np.array(ends(one)) == pytest.approx(np.array([[0, 0], [4.2, 0]]))
    assert np.array(ends(other)) == pytest.approx(np.array([[4.2, 0], [4.2, 3]]))


def test_a_wall_that_runs_past_a_corner_is_shortened_whatever_is_there() -> None:
    _, other = with_closed_corners([LONG, WallLine((2.0, -0.1), (2.0, 3.0), 0.1)], OPEN)
    assert other.start == pytest.approx((2.0, 0.0))


def test_a_wall_that_abuts_another_leaves_that_one_as_it_is() -> None:
    one, other = with_closed_corners([LONG, WallLine((2.0, 0.2), (2.0, 3.0), 0.1)], UNSEEN)
    assert one == LONG
    assert other.start == pytest.approx((2.0, 0.0))


@pytest.mark.parametrize(
    ("grid", "other"),
    [
        (OPEN, WallLine((2.0, 0.5), (2.0, 3.0), 0.1)),  # a passage
        (UNSEEN, WallLine((2.0, 0.9), (2.0, 3.0), 0.1)),  # wider than a door
        (UNSEEN, WallLine((5.0, 0.4), (5.0, 3.0), 0.1)),  # far beyond the end of the other
        (UNSEEN, WallLine((4.3, 0.1), (6.0, 0.4), 0.1)),  # nearly collinear
    ],
)
def test_what_does_not_nearly_meet_stays_apart(grid: PlanGrid, other: WallLine) -> None:
    assert with_closed_corners([LONG, other], grid) == [LONG, other]


def test_what_is_nearly_square_is_made_so_with_its_doorway_and_a_slanted_wall_stays() -> None:
    slanted = WallLine((1.0, 0.0), (1.1, 3.0), 0.1, (((1.03, 1.0), (1.06, 1.8)),))
    straight = straightened(slanted, math.radians(0.3))
    assert np.array([*ends(straight), *straight.doorways[0]])[:, 0] == pytest.approx(1.05, abs=1e-9)
    assert straight.length_m == pytest.approx(slanted.length_m)
    diagonal = WallLine((0.0, 0.0), (2.0, 0.3), 0.1)
    assert straightened(diagonal, 0.0) == diagonal


@pytest.mark.parametrize("turned_deg", [0.0, 1.3, -2.2])
def test_the_fullest_lines_say_which_way_a_flat_is_turned(turned_deg: float) -> None:
    along, rng = np.arange(120.0), np.random.default_rng(0)
    walls = [np.column_stack((along, np.full(120, y))) for y in (0.0, 40.0)]
    walls += [np.column_stack((np.full(80, x), np.arange(80.0))) for x in (0.0, 70.0)]
    turn = Pose.from_degrees(0.0, 0.0, turned_deg)
    points = np.vstack([*walls, rng.uniform(0, 100, (200, 2))])
    turned = np.array([turn.compose(Pose(x, y)).position for x, y in points])
    assert math.degrees(main_direction(turned, math.radians(turned_deg + 0.8))) == pytest.approx(turned_deg, abs=0.5)


def test_in_a_flat_that_is_turned_walls_are_square_to_each_other() -> None:
    turn = math.radians(20)
    off = WallLine((0.0, 0.0), (3 * math.cos(turn + 0.02), 3 * math.sin(turn + 0.02)), 0.1)
    straight = straightened(off, turn)
    way = np.array(straight.end) - straight.start
    assert math.atan2(way[1], way[0]) == pytest.approx(turn)


def test_a_wall_whose_ends_meet_in_one_corner_is_left_out() -> None:
    others = [WallLine((0.0, 0.3), (4.0, 0.3), 0.1), WallLine((2.0, -1.0), (2.0, 3.0), 0.1)]
    short = WallLine((1.8, 0.1), (2.2, 0.5), 0.1)
    assert with_closed_corners([*others, short], OPEN) == others
