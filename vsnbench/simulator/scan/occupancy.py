"""Where a scan has surfaces: points on its triangles, and cells of the floor plan that they occupy."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.rendering.scan.mesh import ScanMesh

CELL_M: Final = 0.025
"""Side of a cell."""
BAND_M: Final = (0.06, 0.60)
"""Heights between which a surface is in a robot's way."""
OUTLINE_M: Final = 0.03
_STEP_M: Final = 0.02
_END_M, _STRETCH_M, _BIN_M = 0.1, 0.05, 0.01
_MOST_POINTS: Final = 8_000_000

Floats = npt.NDArray[np.float64]


def points_on(mesh: ScanMesh) -> Floats:
    """Return points (N, 3) on the triangles, at most 2 cm apart, below 4 m; coarser for more than 8 million."""
    return facing_points_on(mesh)[0]


def facing_points_on(mesh: ScanMesh) -> tuple[Floats, Floats]:
    """Return the same points and where their triangles face on the floor plan, (N, 2) of length 0 to 1.

    Where splats face is unknown: their surfaces face nowhere.
    """
    corners = mesh.corners.astype(np.float64)
    corners = corners[(corners[..., 2].min(axis=1) < 4.0) & (corners[..., 2].max(axis=1) > -1.0)]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = crossed[:, :2] / np.maximum(np.sqrt((crossed * crossed).sum(axis=1)), 1e-12)[:, None]
    if mesh.splats is not None:
        facing[:] = 0
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((sides * sides).sum(axis=2)).max(axis=1)
    counts = np.clip(np.ceil(longest / _STEP_M).astype(int), 1, 2000)
    while (total := int(((counts + 1) * (counts + 2) // 2).sum())) > _MOST_POINTS:
        counts = np.maximum((counts * 0.9 * (_MOST_POINTS / total) ** 0.5).astype(int), 1)
        if counts.max() == 1:
            break
    points, ways = [np.zeros((0, 3))], [np.zeros((0, 2))]
    for count in np.unique(counts):
        these = corners[counts == count]
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        s, t = i[inside] / count, j[inside] / count
        weights = np.stack([1 - s - t, s, t])
        made = sum(weights[k][None, :, None] * these[:, k, None, :] for k in range(3))
        points.append(np.asarray(made).reshape(-1, 3))
        ways.append(facing[counts == count].repeat(inside.sum(), axis=0))
    return np.concatenate(points), np.concatenate(ways)


def occupied_points(samples: Floats, low_m: float, high_m: float) -> Floats:
    """Return the (n, 2) centres of cells with at least two points between two heights."""
    inside = samples[(samples[:, 2] > low_m) & (samples[:, 2] < high_m), :2]
    if not len(inside):
        return inside
    cells = np.floor(inside / CELL_M).astype(np.int64)
    low = cells.min(axis=0)
    rows = int(cells[:, 1].max() - low[1]) + 1
    keys, counts = np.unique((cells[:, 0] - low[0]) * rows + cells[:, 1] - low[1], return_counts=True)
    keys = keys[counts >= 2]
    return np.asarray((np.column_stack([keys // rows, keys % rows]) + low + 0.5) * CELL_M)


def beside(
    samples: Floats, start: tuple[float, float], end: tuple[float, float], reach_m: float
) -> tuple[Floats, Floats, npt.NDArray[np.intp]]:
    """Return where points are along a line and across it (positive left), metres, and the indices of these points.

    Points beyond its ends, or farther from it than the reach, are left out.
    """
    length_m = math.dist(start, end)
    way = (np.array(end) - start) / length_m
    low, high = np.minimum(start, end) - reach_m, np.maximum(start, end) + reach_m
    x, y = samples[:, 0], samples[:, 1]
    chosen = np.flatnonzero((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]))
    local = samples[chosen, :2] - start
    along, across = local @ way, local @ np.array([-way[1], way[0]])
    near = (along > 0) & (along < length_m) & (np.abs(across) < reach_m)
    return along[near], across[near], chosen[near]


def surface_offsets(
    samples: Floats, start: tuple[float, float], end: tuple[float, float], reach_m: float, *, least: float = 0.2
) -> tuple[float | None, float | None]:
    """Return where surfaces run along a line: to its right and to its left, metres from it (positive left).

    Each is the place with the most points; None if points cover less than a share `least` of the line's length.
    """
    length_m = math.dist(start, end)
    along, across, _ = beside(samples, start, end, reach_m)
    near = (along > _END_M) & (along < length_m - _END_M)
    along, across = along[near], across[near]
    places: list[float | None] = []
    for side in (-1.0, 1.0):
        own = side * across >= 0
        covered = len(np.unique((along[own] / _STRETCH_M).astype(int))) * _STRETCH_M
        if covered < least * max(length_m - 2 * _END_M, _STRETCH_M):
            places.append(None)
            continue
        bins = np.bincount((side * across[own] / _BIN_M).astype(int), minlength=math.ceil(reach_m / _BIN_M))
        smooth = np.convolve(bins, np.ones(3), "same")
        places.append(side * (int(np.argmax(smooth)) + 0.5) * _BIN_M)
    return places[0], places[1]
