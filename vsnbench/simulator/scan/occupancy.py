"""Where a scan has surfaces: points on its triangles, and cells of the floor plan that they occupy."""

from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.scan.mesh import ScanMesh

CELL_M: Final = 0.025
"""Side of a cell."""
BAND_M: Final = (0.06, 0.60)
"""Heights between which a surface is in a robot's way."""
OUTLINE_M: Final = 0.03
_STEP_M: Final = 0.02
_MOST_POINTS: Final = 20_000_000

Floats = npt.NDArray[np.float64]


def points_on(mesh: ScanMesh) -> Floats:
    """Return points (N, 3) on the triangles, at most 2 cm apart, below 4 m; coarser for more than 20 million."""
    corners = mesh.corners.astype(np.float64)
    corners = corners[(corners[..., 2].min(axis=1) < 4.0) & (corners[..., 2].max(axis=1) > -1.0)]
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((sides * sides).sum(axis=2)).max(axis=1)
    counts = np.clip(np.ceil(longest / _STEP_M).astype(int), 1, 2000)
    while (total := int(((counts + 1) * (counts + 2) // 2).sum())) > _MOST_POINTS:
        counts = np.maximum((counts * 0.9 * (_MOST_POINTS / total) ** 0.5).astype(int), 1)
        if counts.max() == 1:
            break
    points = []
    for count in np.unique(counts):
        these = corners[counts == count]
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        s, t = i[inside] / count, j[inside] / count
        weights = np.stack([1 - s - t, s, t])
        made = sum(weights[k][None, :, None] * these[:, k, None, :] for k in range(3))
        points.append(np.asarray(made).reshape(-1, 3))
    return np.concatenate(points) if points else np.zeros((0, 3))


def occupied_points(samples: Floats, low_m: float, high_m: float) -> Floats:
    """Return the (n, 2) centres of cells with at least two points between two heights."""
    inside = samples[(samples[:, 2] > low_m) & (samples[:, 2] < high_m), :2]
    cells, counts = np.unique(np.floor(inside / CELL_M).astype(np.int64), axis=0, return_counts=True)
    return np.asarray((cells[counts >= 2] + 0.5) * CELL_M)
