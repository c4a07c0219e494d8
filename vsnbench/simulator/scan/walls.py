"""Finds the walls of a scan: tall furniture in front of a higher wall is none, and openings are doorways."""

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.scan.occupancy import BAND_M, CELL_M, Floats, beside, surface_offsets
from vsnbench.site_checks.map_walls.corners import WallLine, with_closed_corners
from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, UNKNOWN, PlanGrid
from vsnbench.site_checks.map_walls.lines import propose_walls
from vsnbench.values.pose import Pose

SINGLE_M: Final = 0.02
"""Thickness of a wall of which one side was scanned."""
_BAND_M: Final = (1.4, 1.95)
"""Heights in which a wall is seen above most furniture and below the tops of doors."""
_LAYER_M: Final = 0.05
_LAYERS: Final = 52
"""Layers of a column from the lower end of that band to 4 m, the bits of an integer."""
_BAND_LAYERS: Final = 11
_TALL: Final = 0.55
"""Share of that band that a wall's surface covers in a cell."""
_HIGH_M: Final = 2.25
"""Height above most furniture and doors."""
_HIGHEST_M: Final = 0.3
"""Height of the topmost strip of walls, which tall furniture does not reach; for walls that are scanned up to less."""
_CEILING_M: Final = 0.05
_HIGH_LAYERS: Final = 2
_UPRIGHT: Final = 0.8
"""Horizontal part of the normal of a wall's face."""
_DEEPEST_M: Final = 0.9
"""Depth of furniture: a wall that is higher is at most so far behind its front."""
_RECESS_M: Final = 0.25
"""Depth of a window or a niche in a higher wall."""
_IN_FRONT: Final = 0.3
"""Share of a surface that is in front of a higher wall, or in its recess, if it belongs to furniture or a window."""
_LEAST_WALL_M: Final = 0.6
_THICKEST_M: Final = 0.25
"""Distance up to which two surfaces are the sides of one wall."""
_FLOOR_M: Final = 0.08
_OPEN_M: Final = (0.1, 1.7)
"""Heights between which nothing is in an opening."""
_STRIP_M: Final = 0.12
"""Width of the strip of floor at each side of an opening that the scan must have."""
_OPENINGS_M: Final = (0.5, 1.6)
"""Widths of doorways; a wider opening ends the wall."""

Bools = npt.NDArray[np.bool_]


def wall_lines(samples: Floats, facing: Floats) -> list[WallLine]:
    """Return the walls of points on a scan's surfaces, longest first.

    A wall covers most of the heights between 1.4 m and 1.95 m, or reaches the highest parts of the scan's walls. A
    surface that ends lower, with a higher one behind it, is furniture's.

    Args:
        samples: (N, 3) points.
        facing: (N, 2) where their triangles face on the floor plan, 0 for horizontal ones; all 0 if it is unknown.
    """
    length = np.sqrt((facing * facing).sum(axis=1))
    upright = (length > _UPRIGHT) | (not facing.any())
    inside = upright & (samples[:, 2] > _BAND_M[0]) & (samples[:, 2] < _BAND_M[0] + _LAYERS * _LAYER_M)
    if not inside.any():
        return []
    corner = samples[:, :2].min(axis=0) - 0.3
    shape = np.ceil((samples[:, :2].max(axis=0) + 0.3 - corner) / CELL_M).astype(int)[::-1]
    points, ways = samples[inside], facing[inside]
    occupied, top_m = _occupied(points, ways, corner, (int(shape[0]), int(shape[1])))
    near_floor = samples[samples[:, 2] < _OPEN_M[1]]
    floor = ((near_floor[near_floor[:, 2] < _FLOOR_M, :2] - corner) / CELL_M).astype(int)
    cells = np.full(occupied.shape, UNKNOWN, np.uint8)
    cells[floor[:, 1], floor[:, 0]] = FREE
    cells[_grown(occupied, 2)] = UNKNOWN  # the scan drifts
    cells[_closed(occupied)] = OCCUPIED
    grid = PlanGrid(cells, CELL_M, Pose(float(corner[0]), float(corner[1])))
    low_points = near_floor[(near_floor[:, 2] > BAND_M[0]) & (near_floor[:, 2] < BAND_M[1])]
    refined = [_refined(wall, points, ways, low_points) for wall in propose_walls(grid, _LEAST_WALL_M)]
    walls = with_closed_corners(refined, grid)
    if top_m <= _BAND_M[1]:
        return walls
    return sorted((part for wall in walls for part in _opened(wall, near_floor)), key=lambda wall: -wall.length_m)


def _occupied(points: Floats, ways: Floats, corner: Floats, shape: tuple[int, int]) -> tuple[Bools, float]:
    """Return the cells of walls, and the height below which they were looked for."""
    at = ((points[:, :2] - corner) / CELL_M).astype(np.int64)
    layer = ((points[:, 2] - _BAND_M[0]) / _LAYER_M).astype(np.int64)
    keys = np.unique((at[:, 1] * shape[1] + at[:, 0]) * _LAYERS + layer)
    columns = np.zeros(shape[0] * shape[1], np.uint64)
    np.bitwise_or.at(columns, keys // _LAYERS, np.uint64(1) << (keys % _LAYERS).astype(np.uint64))
    filled = columns.reshape(shape)
    # A wall leans by the scan's drift: what its neighbours cover counts too.
    wide = filled.copy()
    wide[1:] |= filled[:-1]
    wide[:-1] |= filled[1:]
    wide[:, 1:] |= filled[:, :-1]
    wide[:, :-1] |= filled[:, 1:]

    def covered(first: int, last: int, least: float) -> Bools:
        """Return the cells that have at least so many of the layers from the first to the one before the last."""
        layers = np.uint64(((1 << last) - 1) ^ ((1 << first) - 1))
        return np.asarray((np.bitwise_count(wide & layers) >= least) & (filled & layers > 0), np.bool_)

    occupied = covered(0, _BAND_LAYERS, _TALL * _BAND_LAYERS)
    if not occupied.any():
        return occupied, 0.0
    tops = np.floor(np.log2(wide[occupied].astype(np.float64))).astype(int) + 1
    top_m = _BAND_M[0] + _LAYER_M * float(np.percentile(tops, 75))
    from_m = max(min(top_m - _HIGHEST_M, _HIGH_M), _BAND_M[1])
    first, last = (round((height - _BAND_M[0]) / _LAYER_M) for height in (from_m, top_m - _CEILING_M))
    if last - first < _HIGH_LAYERS:
        return occupied, 0.0
    high = covered(first, last, _HIGH_LAYERS)
    return high | (occupied & ~_furniture(occupied & ~high, high, at, ways)), top_m


def _furniture(low: Bools, high: Bools, at: npt.NDArray[np.int64], ways: Floats) -> Bools:
    """Return the connected surfaces that have a higher one behind many of their cells, or just in front (windows)."""
    import cv2

    reach, recess = round(_DEEPEST_M / CELL_M), round(_RECESS_M / CELL_M)
    is_unknown = (ways == 0).all(axis=1)
    in_front = np.zeros(low.shape, np.bool_)
    for axis in (0, 1):
        for sign in (-1, 1):
            faces_it = is_unknown | (sign * ways[:, axis] > np.abs(ways[:, 1 - axis]))
            facing = np.zeros(low.shape, np.bool_)
            facing[at[faces_it, 1], at[faces_it, 0]] = True
            # Behind a cell that faces +x are the cells of smaller x.
            line = np.zeros((1, 2 * reach + 1), np.uint8)
            line[0, :reach] = 1
            line[0, reach + 1 : reach + 1 + recess] = 1
            line = line if sign > 0 else line[:, ::-1]
            behind = cv2.dilate(high.astype(np.uint8), np.ascontiguousarray(line if axis == 0 else line.T)) > 0
            in_front |= low & facing & behind
    _, labels = cv2.connectedComponents(_grown(low, 1).astype(np.uint8))
    labels = np.where(low, labels, 0)
    size, front = (np.bincount(labels[cells], minlength=labels.max() + 1) for cells in (low, in_front))
    return np.asarray(low & (front >= _IN_FRONT * np.maximum(size, 1))[labels], np.bool_)


def _grown(cells: Bools, steps: int) -> Bools:
    """Return cells with all that are at most so many steps away."""
    import cv2

    side = 2 * steps + 1
    return np.asarray(cv2.dilate(cells.astype(np.uint8), np.ones((side, side), np.uint8)) > 0, np.bool_)


def _closed(occupied: Bools) -> Bools:
    """Return the cells with the space between both surfaces of a wall."""
    import cv2

    across = round(_THICKEST_M / CELL_M)
    closed = cv2.morphologyEx(occupied.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((across, across), np.uint8))
    return np.asarray(closed > 0, np.bool_)


def _refined(wall: WallLine, points: Floats, ways: Floats, low_points: Floats) -> WallLine:
    """Return a wall moved onto its surfaces, without doorways through which only the camera could pass (windows)."""
    # The line through the cells is up to a cell beside the surface, and so is the surface in its cell.
    right_m, left_m = surface_offsets(points, wall.start, wall.end, wall.thickness_m / 2 + 2 * CELL_M)
    along = (np.array(wall.end) - wall.start) / wall.length_m
    normal = np.array([-along[1], along[0]])
    if right_m is not None and left_m is not None and left_m - right_m > SINGLE_M:
        thickness_m, shift_m = left_m - right_m, (left_m + right_m) / 2
    else:  # one side was scanned: the wall is behind it
        at_m = left_m or right_m or 0.0
        _, across, near = beside(points, wall.start, wall.end, abs(at_m) + CELL_M)
        side = float(np.sign((ways[near[np.abs(across - at_m) < CELL_M]] @ normal).sum()))
        thickness_m, shift_m = SINGLE_M, at_m - side * SINGLE_M / 2
    open_below = [
        gap
        for gap in wall.doorways
        if math.dist(*gap) > 0.3 and surface_offsets(low_points, *gap, wall.thickness_m / 2 + 0.1) == (None, None)
    ]
    moved = replace(wall, thickness_m=thickness_m, doorways=tuple(open_below))
    return _shifted(moved, normal * shift_m)


def _shifted(wall: WallLine, shift: Floats) -> WallLine:
    def moved(point: tuple[float, float]) -> tuple[float, float]:
        x, y = (np.array(point) + shift).tolist()
        return (x, y)

    gaps = tuple((moved(first), moved(last)) for first, last in wall.doorways)
    return replace(wall, start=moved(wall.start), end=moved(wall.end), doorways=gaps)


def _opened(wall: WallLine, near_floor: Floats) -> list[WallLine]:
    """Return a wall with the doorways below its lintels, cut where an opening is wider than a doorway.

    In an opening the floor continues through the wall, and nothing is between the knees and the head of a person.
    """
    along = (np.array(wall.end) - wall.start) / wall.length_m
    half_m = wall.thickness_m / 2
    place, across, near = beside(near_floor, wall.start, wall.end, half_m + _STRIP_M)
    heights = near_floor[near, 2]
    count = max(math.ceil(wall.length_m / CELL_M), 1)
    bins = np.minimum((place / CELL_M).astype(int), count - 1)

    def has(points: npt.NDArray[Any]) -> Bools:
        return np.bincount(bins[points], minlength=count) > 0

    on_floor = heights < _FLOOR_M
    in_the_way = (heights > _OPEN_M[0]) & (np.abs(across) < half_m + 2 * CELL_M)
    floor = has(on_floor & (across > half_m)) & has(on_floor & (across < -half_m))
    # Single points are noise, single gaps are holes of the scan.
    is_open = np.bincount(bins[in_the_way], minlength=count) < 2
    gaps = []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_open, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2).tolist():
        if (last - first) * CELL_M >= _OPENINGS_M[0] and floor[first:last].mean() > 0.7:
            gaps.append((max(first * CELL_M, 0.0), min(last * CELL_M, wall.length_m)))
    doorways, parts, begin_m = list(wall.doorways), [], 0.0

    def point(at_m: float) -> tuple[float, float]:
        x, y = (np.array(wall.start) + at_m * along).tolist()
        return (x, y)

    stretches = []
    for first_m, last_m in gaps:
        at_end = first_m < 2 * CELL_M or last_m > wall.length_m - 2 * CELL_M
        if at_end or last_m - first_m > _OPENINGS_M[1]:
            stretches.append((begin_m, first_m))
            begin_m = last_m
        elif not any(_within(gap, point(first_m), along, last_m - first_m) for gap in doorways):
            doorways.append((point(first_m), point(last_m)))
    for first_m, last_m in [*stretches, (begin_m, wall.length_m)]:
        if last_m - first_m > _OPENINGS_M[0] / 2:
            own = tuple(
                gap for gap in doorways if first_m <= float((np.mean(gap, axis=0) - wall.start) @ along) <= last_m
            )
            parts.append(replace(wall, start=point(first_m), end=point(last_m), doorways=own))
    return parts


def _within(gap: tuple[tuple[float, float], ...], start: tuple[float, float], along: Floats, length_m: float) -> bool:
    """Whether a doorway overlaps a stretch."""
    low_m, high_m = sorted(float((np.array(end) - start) @ along) for end in gap)
    return low_m < length_m and high_m > 0
