"""The low-level planner: fast marching over the map to a sub-goal, then a search over short sequences of actions.

Obstacles are inflated by the robot's radius and the clearance; if no path is left, by less, down to the radius.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.sensing.occupancy_map import OccupancyMap
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

FloatGrid = npt.NDArray[np.float64]
BoolGrid = npt.NDArray[np.bool_]
Point = tuple[float, float]

_SIDE_MARGIN_M: Final = 0.02
"""Added to the radius on both sides of the swath that must be free ahead."""
_COMFORT_M: Final = 0.15
"""Width of a slow zone around inflated obstacles, which keeps the path in the middle of passages."""
_EDGE_SLOWNESS: Final = 3.0
_UNKNOWN_SLOWNESS: Final = 1.5
_FIELD_MARGIN_M: Final = 2.5
"""Distance beyond the robot to which the search over actions needs the field."""
_SHORT_SEARCH, _LONG_SEARCH = 2, 4
"""Number of forward moves in a sequence: two as in the original, or more if those fail."""
_MAX_PATH_POINTS: Final = 4000


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """Free space for the robot's centre on the current map."""

    map: OccupancyMap
    obstacles: BoolGrid
    clearance_m: FloatGrid
    """(rows, columns): distance from each cell's centre to the nearest obstacle's."""
    open_cells: BoolGrid
    slowness: npt.NDArray[np.float32]
    """(rows, columns): cost of crossing a cell in metres of path; infinite if it is not open."""

    def is_open(self, x_m: float, y_m: float) -> bool:
        """Return whether the robot's centre can be at a point."""
        cell = self.map.cell_at(x_m, y_m)
        return self.map.holds(cell) and bool(self.open_cells[cell.row, cell.column])

    def sees(self, start: Point, end: Point) -> bool:
        """Return whether the straight line is free of obstacles."""
        steps = max(2, math.ceil(math.dist(start, end) / (self.map.resolution_m / 2)))
        for k in range(steps + 1):
            cell = self.map.cell_at(
                start[0] + (end[0] - start[0]) * k / steps, start[1] + (end[1] - start[1]) * k / steps
            )
            if self.map.holds(cell) and self.obstacles[cell.row, cell.column]:
                return False
        return True


class Planner:
    """Plans for one robot."""

    def __init__(self, settings: VLVSettings) -> None:
        self._settings = settings
        self._keys: npt.NDArray[np.float64] = np.zeros(0)
        self._cells: npt.NDArray[np.int32] = np.zeros(0, np.int32)

    def terrain(self, grid: OccupancyMap, pose: Pose, clearance_m: float) -> Terrain:
        """Return the free space with a clearance in addition to the radius; it includes the robot's position."""
        import cv2

        obstacles = grid.occupied
        distance = cv2.distanceTransform((~obstacles).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        away_m = np.asarray(distance, np.float64) * grid.resolution_m
        if not obstacles.any():
            away_m = np.full(obstacles.shape, np.inf)
        wanted_m = self._settings.robot_radius_m + clearance_m
        open_cells = away_m >= wanted_m
        here = grid.cell_at(pose.x_m, pose.y_m)
        own_m = float(away_m[here.row, here.column])
        if own_m < wanted_m:  # too near to an obstacle: it may leave, but not come nearer
            rows, columns = np.arange(obstacles.shape[0])[:, None], np.arange(obstacles.shape[1])[None, :]
            nearby = np.hypot(rows - here.row, columns - here.column) * grid.resolution_m <= wanted_m
            open_cells |= nearby & (away_m >= own_m - grid.resolution_m / 4) & ~obstacles
            open_cells[here.row, here.column] = True
        ease = np.clip((away_m - wanted_m) / _COMFORT_M, 0.0, 1.0)
        slowness = grid.resolution_m * (_EDGE_SLOWNESS - (_EDGE_SLOWNESS - 1.0) * ease)
        slowness[~grid.known] *= _UNKNOWN_SLOWNESS
        slowness[~open_cells] = np.inf
        return Terrain(grid, obstacles, away_m, open_cells, slowness.astype(np.float32))

    def route(self, terrain: Terrain, targets: BoolGrid, pose: Pose) -> FloatGrid | None:
        """Return path costs to the nearest target cell that is open, or None if none can be reached from `pose`.

        The costs have the shape (rows, columns) and are in metres. They are infinite where there is no path, and where
        one would cost over `_FIELD_MARGIN_M` more than the robot's.
        """
        sources = np.flatnonzero(targets & terrain.open_cells)
        if sources.size == 0:
            return None
        here = terrain.map.cell_at(pose.x_m, pose.y_m)
        wanted = here.row * terrain.map.shape[1] + here.column
        field = self._march(terrain.slowness, sources, wanted, _FIELD_MARGIN_M)
        return field if math.isfinite(value_at(field, terrain.map, pose.position)) else None

    def lengths_from(self, terrain: Terrain, pose: Pose) -> FloatGrid:
        """Return (rows, columns): length in metres of the shortest path from `pose` to each cell."""
        here = terrain.map.cell_at(pose.x_m, pose.y_m)
        even = np.where(terrain.open_cells, np.float32(terrain.map.resolution_m), np.float32(np.inf))
        sources = np.array([here.row * terrain.map.shape[1] + here.column])
        return self._march(even.astype(np.float32), sources, -1, 0.0)

    def next_action(
        self, terrain: Terrain, field_m: FloatGrid, pose: Pose, *, forward_refused: bool = False
    ) -> Action | None:
        """Return the first action of the best short sequence, or None if no sequence leads nearer to the target."""
        from vsnbench.models.vlv.marching_kernels import search_actions

        settings, grid = self._settings, terrain.map
        body = np.array(
            [
                settings.forward_m,
                settings.robot_radius_m + _SIDE_MARGIN_M,
                settings.robot_radius_m + settings.look_ahead_m,
            ]
        )
        frame = np.array([grid.origin_x_m, grid.origin_y_m, grid.resolution_m])
        start = np.array([pose.x_m, pose.y_m, pose.heading_rad])
        turn_rad = math.radians(settings.turn_deg)
        for depth in (_SHORT_SEARCH, _LONG_SEARCH):
            plan = np.zeros(depth, np.int64)
            cost = search_actions(
                field_m,
                terrain.open_cells,
                terrain.obstacles,
                frame,
                body,
                start,
                turn_rad,
                forward_refused,
                depth,
                plan,
            )
            if math.isfinite(cost):
                turns = int(plan[0])
                if turns == 0:
                    return Action.MOVE_FORWARD
                return Action.TURN_LEFT if turns > 0 else Action.TURN_RIGHT
        return None

    def _march(
        self, slowness: npt.NDArray[np.float32], sources: npt.NDArray[np.intp], wanted: int, margin_m: float
    ) -> FloatGrid:
        from vsnbench.models.vlv.marching_kernels import march

        needed = 5 * slowness.size
        if self._keys.size < needed:
            self._keys, self._cells = np.zeros(needed), np.zeros(needed, np.int32)
        field = np.empty(slowness.shape)
        march(slowness, sources.astype(np.int64), wanted, margin_m, field, self._keys, self._cells)
        return field


def value_at(field: FloatGrid, grid: OccupancyMap, point: Point) -> float:
    """Return a field's value at a point; infinity outside the map."""
    cell = grid.cell_at(*point)
    return float(field[cell.row, cell.column]) if grid.holds(cell) else math.inf


def path_of(terrain: Terrain, field_m: FloatGrid, pose: Pose) -> tuple[Point, ...]:
    """Return the path from the robot to the target along the steepest descent of the field.

    The path does not enter cells that are not open, or cut their corners.
    """
    grid, field, open_cells = terrain.map, field_m, terrain.open_cells
    rows, columns = field.shape
    cell = grid.cell_at(pose.x_m, pose.y_m)
    path: list[Point] = [(pose.x_m, pose.y_m)]
    if not grid.holds(cell) or not math.isfinite(field[cell.row, cell.column]):
        return ()
    at_row, at_column = cell.row, cell.column
    while field[at_row, at_column] > 0 and len(path) < _MAX_PATH_POINTS:
        best, best_cell = 0.0, None
        for r, c in _around(at_row, at_column, rows, columns):
            if not (open_cells[r, c] and open_cells[at_row, c] and open_cells[r, at_column]):
                continue
            drop = (field[at_row, at_column] - field[r, c]) / math.hypot(r - at_row, c - at_column)
            if drop > best:
                best, best_cell = drop, (r, c)
        if best_cell is None:
            break
        at_row, at_column = best_cell
        path.append(
            (
                grid.origin_x_m + (at_column + 0.5) * grid.resolution_m,
                grid.origin_y_m + (at_row + 0.5) * grid.resolution_m,
            )
        )
    return tuple(path)


def _around(row: int, column: int, rows: int, columns: int) -> Iterable[tuple[int, int]]:
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        for c in range(max(column - 1, 0), min(column + 2, columns)):
            if (r, c) != (row, column):
                yield r, c
