"""Walls of a scan: what tells them from tall furniture, and where their doorways are."""

import numpy as np
import pytest

from tests.simulator.scan.rooms import of_quads
from tests.simulator.scan.test_comparison import upright
from vsnbench.simulator.scan.occupancy import facing_points_on
from vsnbench.simulator.scan.walls import wall_lines
from vsnbench.site_checks.map_walls.corners import WallLine

Quads = list[np.ndarray]


def floor(wide_m: float = 5.0, deep_m: float = 4.0) -> np.ndarray:
    return np.array([(0, 0, 0), (wide_m, 0, 0), (wide_m, deep_m, 0), (0, deep_m, 0)], float)


def walls(high_m: float = 2.5, north_m: float | None = None) -> Quads:
    """Return the walls of a room of 5 x 4 m as seen from inside; the northern one may have been scanned up to less."""
    around = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
    heights = [high_m, high_m, north_m or high_m, high_m]
    return [upright(around[k], around[(k + 1) % 4], 0.0, heights[k]) for k in range(4)]


def block(x0: float, x1: float, depth_m: float, low_m: float, top_m: float) -> Quads:
    """Return front and sides of furniture at the northern wall."""
    y = 4.0 - depth_m
    return [
        upright((x1, y), (x0, y), low_m, top_m),
        upright((x0, y), (x0, 4.0), low_m, top_m),
        upright((x1, 4.0), (x1, y), low_m, top_m),
    ]


def proposed(quads: Quads) -> list[WallLine]:
    return wall_lines(*facing_points_on(of_quads(np.array([floor(), *quads]), textured=False)))


def sides(lines: list[WallLine]) -> list[tuple[str, float]]:
    """Return the axis that each wall is parallel to, and where it is on the other one."""
    found = []
    for line in lines:
        (x0, y0), (x1, y1) = line.start, line.end
        across = abs(x1 - x0) < abs(y1 - y0)
        found.append(("y", round((x0 + x1) / 2, 1)) if across else ("x", round((y0 + y1) / 2, 1)))
    return sorted(found)


ROOM = [("x", 0.0), ("x", 4.0), ("y", 0.0), ("y", 5.0)]


def test_tall_furniture_in_front_of_a_higher_wall_is_none() -> None:
    refrigerator, wardrobe = block(0.0, 0.7, 0.7, 0.0, 1.85), block(3.4, 5.0, 0.6, 0.0, 2.1)
    cabinet = block(1.0, 3.0, 0.34, 1.45, 2.15)
    hidden = [quad for quad in walls() if not (quad[:, 1] == 4.0).all()]
    above = [
        upright((5.0, 4.0), (3.4, 4.0), 2.2, 2.5),
        upright((3.4, 4.0), (3.0, 4.0), 0.0, 2.5),
        upright((3.0, 4.0), (1.0, 4.0), 2.2, 2.5),
        upright((1.0, 4.0), (0.0, 4.0), 2.0, 2.5),
    ]
    assert sides(proposed([*hidden, *above, *refrigerator, *wardrobe, *cabinet])) == ROOM


def test_a_wall_that_was_scanned_up_to_less_than_the_others_is_one() -> None:
    assert sides(proposed(walls(north_m=2.0))) == ROOM
    assert sides(proposed(walls(high_m=1.9))) == ROOM


def test_the_pane_of_a_window_is_no_wall_behind_its_wall() -> None:
    around = [upright((5, 4), (3, 4)), upright((2, 4), (0, 4)), upright((3, 4), (2, 4), 0, 0.9)]
    window = [upright((3, 4), (2, 4), 2.2), upright((3, 4.15), (2, 4.15), 0.9, 2.2)]
    others = [quad for quad in walls() if not (quad[:, 1] == 4.0).all()]
    assert sides(proposed([*others, *around, *window])) == ROOM


def _divided(width_m: float) -> list[WallLine]:
    """Return the walls of a room with a wall in the middle, which has an opening below a lintel."""
    first, last = 2.0 - width_m / 2, 2.0 + width_m / 2
    parts = [(0.0, first, 0.0), (first, last, 2.05), (last, 4.0, 0.0)]
    quads = [upright((2.55, a), (2.55, b), low)[::-1] for a, b, low in parts]
    quads += [upright((2.45, b), (2.45, a), low)[::-1] for a, b, low in parts]
    return proposed([*walls(), *quads])


def test_an_opening_below_a_lintel_is_a_doorway() -> None:
    (inner,) = [line for line in _divided(0.8) if sides([line]) == [("y", 2.5)]]
    ((start, end),) = inner.doorways
    assert sorted([start[1], end[1]]) == [pytest.approx(1.6, abs=0.04), pytest.approx(2.4, abs=0.04)]
    assert inner.thickness_m == pytest.approx(0.1, abs=0.03)


def test_a_wide_opening_ends_the_wall() -> None:
    parts = [line for line in _divided(2.2) if sides([line]) == [("y", 2.5)]]
    assert [round(line.length_m, 1) for line in parts] == [0.9, 0.9]
    assert all(line.doorways == () for line in parts)
