"""Regions of the occupancy map: disks, frontiers and lines of sight."""

import math
from collections.abc import Iterable

import numpy as np

from vsnbench.models.vlv.planner import BoolGrid, Point
from vsnbench.sensing.occupancy_map import OccupancyMap


def disk(grid: OccupancyMap, point: Point, radius_m: float) -> BoolGrid:
    """Return the cells whose centres are within a distance of a point, and the point's own cell."""
    mask = np.zeros(grid.shape, np.bool_)
    cell = grid.cell_at(*point)
    reach = math.ceil(radius_m / grid.resolution_m) + 1
    rows, columns = grid.shape
    top, left = max(cell.row - reach, 0), max(cell.column - reach, 0)
    bottom, right = min(cell.row + reach + 1, rows), min(cell.column + reach + 1, columns)
    if top >= bottom or left >= right:
        return mask
    y_m = grid.origin_y_m + (np.arange(top, bottom) + 0.5) * grid.resolution_m
    x_m = grid.origin_x_m + (np.arange(left, right) + 0.5) * grid.resolution_m
    mask[top:bottom, left:right] = np.hypot(y_m[:, None] - point[1], x_m[None, :] - point[0]) <= radius_m
    if grid.holds(cell):
        mask[cell.row, cell.column] = True
    return mask


def frontier_away_from(
    grid: OccupancyMap, visited: Iterable[Point], radius_m: float, smallest_cells: int = 1
) -> BoolGrid:
    """Return the free cells next to unknown cells, without those within a radius of visited points.

    Unknown areas count from a square with a side of `smallest_cells`.
    """
    import cv2

    known, obstacles = grid.known, grid.occupied
    if smallest_cells > 1:
        square = np.ones((smallest_cells, smallest_cells), np.uint8)
        known = ~cv2.morphologyEx((~known).astype(np.uint8), cv2.MORPH_OPEN, square).astype(np.bool_)
    next_to_unknown = np.zeros(known.shape, np.bool_)
    next_to_unknown[1:] |= ~known[:-1]
    next_to_unknown[:-1] |= ~known[1:]
    next_to_unknown[:, 1:] |= ~known[:, :-1]
    next_to_unknown[:, :-1] |= ~known[:, 1:]
    frontier: BoolGrid = next_to_unknown & known & ~obstacles
    for point in visited:
        frontier &= ~disk(grid, point, radius_m)
    return frontier


def in_sight(grid: OccupancyMap, obstacles: BoolGrid, start: Point, end: Point, length_m: float) -> bool:
    """Return whether the first `length_m` of the straight line from start to end are free."""
    whole_m = math.dist(start, end)
    for k in range(max(1, math.ceil(max(length_m, 0.0) / grid.resolution_m))):
        share = k * grid.resolution_m / whole_m
        cell = grid.cell_at(start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
        if grid.holds(cell) and obstacles[cell.row, cell.column]:
            return False
    return True
