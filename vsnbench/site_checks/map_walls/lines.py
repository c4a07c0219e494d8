"""Proposes walls from an occupancy grid: centre lines with a thickness.

The directions of walls are found first, since rooms have few. Occupied cells along each direction are grouped into
runs, strip by strip, and adjacent runs become one wall. Short or thick runs are furniture and are ignored. Two
collinear walls with a doorway between them become one wall with a doorway.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vsnbench.site_checks.map_walls.corners import WallLine, main_direction, straightened, with_closed_corners
from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, PlanGrid

SHORTEST_M = 0.6
"""Minimum length of a run; shorter ones are often furniture."""
THICKEST_M = 0.4
NARROWEST_DOOR_M, WIDEST_DOOR_M = 0.6, 1.2
"""Width of a gap between collinear walls that is a doorway."""
_STUB_M = 0.2
"""Minimum length of a wall beyond a doorway."""
_OPEN, _UNOBSTRUCTED = 0.5, 0.9
"""Minimum share of a doorway's width that is known to be free, and that is not occupied."""
_IN_LINE_M, _IN_LINE_RAD = 0.08, math.radians(4)
_BRIDGED_M = 0.25
"""Maximum gap in a run; such gaps are dropouts of the map."""
_DIRECTIONS = 5
"""Maximum number of directions; rooms have two, and a diagonal wall is a third."""
_LEAST_SHARE = 0.02
"""Minimum share of the weight of all lines in one direction."""
_FILLED = 0.6
_AS_LONG = 0.7
"""Minimum overlap of an adjacent strip that belongs to a wall's thickness."""
_LONGER = 0.85
"""The same for a wall that would be too thick otherwise."""
_TAKEN = 0.5
"""Maximum share of a run's cells that belong to other walls."""
_STEP_DEG = 1.0

Points = npt.NDArray[np.float64]


def propose_walls(grid: PlanGrid, shortest_m: float = SHORTEST_M) -> list[WallLine]:
    """Return proposed walls, longest first."""
    rows, columns = np.nonzero(grid.cells == OCCUPIED)
    if rows.size == 0:
        return []
    points = np.column_stack((columns + 0.5, rows + 0.5))
    left = np.ones(len(points), np.bool_)
    directions = _directions(grid)

    def lines(at_least_m: float) -> list[WallLine]:
        found = []
        for wall in _fitted_walls(points, left.copy(), directions, grid.resolution_m, at_least_m):
            (x0, y0), (x1, y1) = grid.in_site(np.array([wall.first, wall.last])).tolist()
            found.append(WallLine((x0, y0), (x1, y1), max(wall.thickness * grid.resolution_m, 0.02)))
            left[wall.cells] = False
        return found

    walls = lines(shortest_m)
    stubs = lines(_STUB_M)
    joined = _joined(walls, stubs, grid)
    main_rad = main_direction(points, directions[0]) + grid.origin.heading_rad
    straight, straight_stubs = ([straightened(line, main_rad) for line in lines] for lines in (joined, stubs))
    # Join again: a wall that a cupboard next to it made slanted may be collinear now.
    whole = _joined(straight, straight_stubs, grid)
    return sorted(with_closed_corners(whole, grid), key=lambda line: -line.length_m)


def _joined(walls: list[WallLine], stubs: list[WallLine], grid: PlanGrid) -> list[WallLine]:
    """Join collinear walls with a doorway between them; a stub counts only beyond a doorway."""
    left, whole = sorted(walls, key=lambda line: -line.length_m), []
    beyond = list(stubs)
    while left:
        wall = left.pop(0)
        for others in (left, beyond):
            found = next(((other, union) for other in others if (union := _over_doorway(wall, other, grid))), None)
            if found:
                others.remove(found[0])
                left.insert(0, found[1])
                break
        else:
            whole.append(wall)
    return whole


def _over_doorway(wall: WallLine, other: WallLine, grid: PlanGrid) -> WallLine | None:
    """Return the union of two walls with a doorway between them; None without a doorway."""
    way = (np.array(wall.end) - wall.start) / wall.length_m
    normal = np.array([-way[1], way[0]])
    ends = [np.array(other.start) - wall.start, np.array(other.end) - wall.start]
    near, far = sorted(ends, key=lambda end: abs(float(end @ way) - wall.length_m / 2))
    ahead = float(near @ way) > wall.length_m / 2
    gap_m = float(near @ way) - wall.length_m if ahead else -float(near @ way)
    slack_m = grid.resolution_m  # noise may shift each jamb by a cell
    if not NARROWEST_DOOR_M - 2 * slack_m <= gap_m <= WIDEST_DOOR_M + slack_m or abs(float(near @ normal)) > _IN_LINE_M:
        return None
    turn = abs(math.atan2(float((far - near) @ normal), abs(float((far - near) @ way))))
    if turn > _IN_LINE_RAD and abs(float(far @ normal)) > _IN_LINE_M:
        return None
    jambs = np.array([wall.end if ahead else wall.start, near + wall.start])
    cells = grid.cells_at(jambs[0] + np.linspace(0.15, 0.85, 15)[:, None] * (jambs[1] - jambs[0]))
    if np.mean(cells == FREE) < _OPEN or np.mean(cells == OCCUPIED) > 1 - _UNOBSTRUCTED:
        return None
    start, end = (np.array(wall.start if ahead else wall.end), far + wall.start)
    along = (end - start) / np.hypot(*(end - start))

    def on_it(point: npt.ArrayLike) -> tuple[float, float]:
        x, y = (start + along * float((np.asarray(point) - start) @ along)).tolist()
        return (x, y)

    openings = [*wall.doorways, *other.doorways, (jambs[0], jambs[1])]
    weight = np.array([wall.length_m, other.length_m])
    thickness_m = float(np.average([wall.thickness_m, other.thickness_m], weights=weight))
    doorways = tuple((on_it(first), on_it(last)) for first, last in openings)
    return WallLine(on_it(start), on_it(end), thickness_m, doorways)


def _directions(grid: PlanGrid) -> list[float]:
    """Return the directions of the walls, radians in the grid, most frequent first."""
    import cv2

    image = (grid.cells == OCCUPIED).astype(np.uint8) * 255
    shortest = max(round(0.4 / grid.resolution_m), 5)
    lines = cv2.HoughLinesP(image, 1, np.pi / 360, shortest, None, shortest, max(round(0.1 / grid.resolution_m), 1))
    if lines is None:
        return [0.0, math.pi / 2]
    ends = np.asarray(lines, np.float64).reshape(-1, 4)
    along = ends[:, 2:] - ends[:, :2]
    length, angle = np.hypot(*along.T), np.degrees(np.arctan2(along[:, 1], along[:, 0])) % 180
    bins = round(180 / _STEP_DEG)
    weight = np.bincount(np.round(angle / _STEP_DEG).astype(int) % bins, length**2, bins)
    smooth = weight + np.roll(weight, 1) + np.roll(weight, -1)
    total, chosen = smooth.sum(), []
    for _ in range(_DIRECTIONS):
        best = int(np.argmax(smooth))
        if smooth[best] < _LEAST_SHARE * total or smooth[best] == 0:
            break
        off = (angle - best * _STEP_DEG + 90) % 180 - 90
        near = np.abs(off) <= 2
        if near.any():
            chosen.append(math.radians(best * _STEP_DEG + float(np.average(off[near], weights=length[near] ** 2))))
        smooth[[(best + step) % bins for step in range(-8, 9)]] = 0
    return chosen or [0.0, math.pi / 2]


@dataclass(frozen=True, slots=True, eq=False)
class _CellRun:
    """Consecutive occupied cells in a strip of one cell's width along a direction."""

    strip: int
    first: float
    last: float
    cells: npt.NDArray[np.intp]

    @property
    def length(self) -> float:
        return self.last - self.first + 1


class _FittedWall(NamedTuple):
    """Ends of a wall's centre line and its thickness, in cells, and the indices of its cells."""

    first: Points
    last: Points
    thickness: float
    cells: npt.NDArray[np.intp]


def _fitted_walls(
    points: Points, left: npt.NDArray[np.bool_], directions: list[float], resolution_m: float, shortest_m: float
) -> Iterator[_FittedWall]:
    """Yield the walls along the given directions.

    A cell belongs to the longest line through it in any direction, so that the side of a cupboard takes no cells from
    a wall.
    """
    ways = [np.array([math.cos(angle), math.sin(angle)]) for angle in directions]
    runs = [_strips(points, np.flatnonzero(left), way, resolution_m, shortest_m) for way in ways]
    taken, rims = ~left, np.zeros((len(ways), len(points)), np.bool_)
    order = [(number, run) for number, along in enumerate(runs) for run in along]
    for number, seed in sorted(order, key=lambda item: -item[1].length):
        gone = taken | rims[number]
        if gone[seed.cells].mean() > _TAKEN:
            continue
        whole = wall = _grown(seed, runs[number], gone, _AS_LONG)
        if _too_thick(wall, resolution_m):
            wall = _grown(seed, runs[number], gone, _LONGER)  # an object may be against it
        if _too_thick(wall, resolution_m):
            rims[number, np.concatenate([run.cells for run in whole])] = True  # furniture
            continue
        fitted = _one_wall(wall, points, ways[number])
        taken[fitted.cells] = True
        rims[number, _near(points, fitted, ways[number], 1.5)] = True
        yield fitted


def _too_thick(wall: list[_CellRun], resolution_m: float) -> bool:
    return len({run.strip for run in wall}) * resolution_m > THICKEST_M


def _grown(seed: _CellRun, runs: list[_CellRun], gone: npt.NDArray[np.bool_], as_long: float) -> list[_CellRun]:
    """Return a run with the adjacent runs of the strips on both sides that overlap at least `as_long` of it."""
    wall = [seed]
    for step in (-1, 1):
        strip = seed.strip + step
        while adjacent := [run for run in runs if run.strip == strip and _is_adjacent(run, seed, gone, as_long)]:
            wall += adjacent
            strip += step
    return wall


def _strips(
    points: Points, indices: npt.NDArray[np.intp], way: Points, resolution_m: float, shortest_m: float
) -> list[_CellRun]:
    along = points[indices] @ way
    across = points[indices] @ np.array([-way[1], way[0]])
    strips = np.floor(across).astype(int)
    gap, shortest = max(_BRIDGED_M / resolution_m, 2.5), shortest_m / resolution_m
    found = []
    for strip in np.unique(strips):
        inside = np.flatnonzero((strips >= strip) & (strips <= strip + 1))  # a slanted run crosses two strips
        order = inside[np.argsort(along[inside])]
        for run in np.split(order, np.flatnonzero(np.diff(along[order]) > gap) + 1):
            length = along[run[-1]] - along[run[0]] + 1
            if length >= shortest and np.unique(np.floor(along[run] + 1e-6)).size >= _FILLED * length:
                found.append(_CellRun(int(strip), float(along[run[0]]), float(along[run[-1]]), indices[run]))
    return found


def _is_adjacent(run: _CellRun, seed: _CellRun, gone: npt.NDArray[np.bool_], as_long: float) -> bool:
    """Whether a run belongs to the thickness of the seed's wall."""
    shared = min(run.last, seed.last) - max(run.first, seed.first)
    return shared > as_long * seed.length and not gone[run.cells].mean() > _TAKEN


def _near(points: Points, wall: _FittedWall, way: Points, margin: float) -> npt.NDArray[np.bool_]:
    """Return which cells are in a wall or within `margin` cells of it."""
    normal = np.array([-way[1], way[0]])
    along, across = (points - wall.first) @ way, (points - wall.first) @ normal
    end = float((wall.last - wall.first) @ way)
    slope = float((wall.last - wall.first) @ normal) / end
    inside: npt.NDArray[np.bool_] = (along > -1) & (along < end + 1)
    return np.asarray(inside & (np.abs(across - slope * along) < wall.thickness / 2 + margin), np.bool_)


def _one_wall(group: list[_CellRun], points: Points, way: Points) -> _FittedWall:
    """Fit a centre line through the cells of a group."""
    used = np.unique(np.concatenate([run.cells for run in group]))
    normal = np.array([-way[1], way[0]])
    along, across = points[used] @ way, points[used] @ normal
    slope, offset = np.polyfit(along, across, 1) if np.ptp(along) > 0 else (0.0, float(across.mean()))
    first, last = (way * at + normal * (slope * at + offset) for at in (along.min() - 0.5, along.max() + 0.5))
    residual = across - (slope * along + offset)
    thickness = float(np.clip(np.sqrt(12) * residual.std() + 0.3, 1.0, None))
    return _FittedWall(first, last, thickness, used)
