"""Shortest path on which the operator moves a robot by hand to its next mark."""

import numpy as np
import shapely

from vsnbench.protocol.free_space import RESOLUTION_M, FloatGrid, FreeSpace, distance_field_m
from vsnbench.values.pose import Pose

_STRAIGHT_M = 0.06
"""Corners nearer than this to a straight line are omitted."""
_NEIGHBOURS = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column]


def carry_path(space: FreeSpace, robot: Pose, mark: Pose) -> list[tuple[float, float]]:
    """Return the corners of the shortest path through free space, metres; empty if there is none."""
    level = np.hypot(space.x_m - mark.x_m, space.y_m - mark.y_m) - 2 * RESOLUTION_M
    field = distance_field_m(space.cells, level)
    row, column = _nearest_free(space, field, robot)
    if not np.isfinite(field[row, column]):
        return []
    points = [(robot.x_m, robot.y_m)]
    rows, columns = field.shape
    while field[row, column] > 0.0:
        around = [(row + up, column + right) for up, right in _NEIGHBOURS]
        inside = [(r, c) for r, c in around if 0 <= r < rows and 0 <= c < columns]
        following = min(inside, key=lambda cell: float(field[cell]))
        if field[following] >= field[row, column]:
            return []
        row, column = following
        points.append((float(space.x_m[row, column]), float(space.y_m[row, column])))
    points.append((mark.x_m, mark.y_m))
    line = shapely.LineString(points).simplify(_STRAIGHT_M)
    return [(float(x), float(y)) for x, y in line.coords]


def _nearest_free(space: FreeSpace, field: FloatGrid, pose: Pose) -> tuple[int, int]:
    """Return the nearest cell with a path to the mark: the robot may touch an object."""
    row, column = space.cell_of(pose.x_m, pose.y_m)
    if np.isfinite(field[row, column]):
        return row, column
    away = np.where(np.isfinite(field), np.hypot(space.x_m - pose.x_m, space.y_m - pose.y_m), np.inf)
    best = int(np.argmin(away))
    return best // field.shape[1], best % field.shape[1]
