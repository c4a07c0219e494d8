"""The occupancy map: depth images and odometry into free and occupied cells, growing with the known area.

A cell is an obstacle where at least two points of an image lie between the floor's band and the robot's height. Votes
of later images add up, so that what was seen once by mistake, or has moved, can be cleared.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.decision import GridMap
from vsnbench.protocol.pose import Pose
from vsnbench.sensing.plan_grid import FREE, OCCUPIED, UNKNOWN

_START_HALF_M: Final = 5.0
_GROW_CELLS: Final = 40


@dataclass(frozen=True, slots=True)
class MappingSettings:
    """How depth becomes cells."""

    resolution_m: float = 0.05
    """Side of a cell."""
    range_m: float = 5.0
    """Farther depth is not drawn."""
    obstacle_bottom_m: float = 0.2
    """Lower points are floor."""
    obstacle_top_m: float | None = 1.2
    """Higher points pass above the robot; None is the camera's height."""
    obstacle_points: int = 2
    """Points that make a cell an obstacle."""
    robot_radius_m: float = 0.177
    """Where the robot stands is free."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of the grid as it is now; growth shifts them."""

    row: int
    column: int


class OccupancyMap:
    """A grid in the frame in which the poses are given that it is drawn from: the episode's start."""

    def __init__(self, settings: MappingSettings | None = None) -> None:
        self._settings = settings = settings if settings is not None else MappingSettings()
        self.resolution_m = settings.resolution_m
        side = 2 * math.ceil(_START_HALF_M / self.resolution_m)
        self.origin_x_m = self.origin_y_m = -side / 2 * self.resolution_m
        self._evidence = np.zeros((side, side), np.float32)
        self._observed = np.zeros((side, side), np.bool_)
        self._bumps = np.zeros((side, side), np.bool_)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        rows, columns = self._evidence.shape
        return (rows, columns)

    @property
    def occupied(self) -> npt.NDArray[np.bool_]:
        """(rows, columns): obstacles, seen or bumped into."""
        return (self._observed & (self._evidence > 0)) | self._bumps

    @property
    def known(self) -> npt.NDArray[np.bool_]:
        """(rows, columns): cells that something is known about."""
        return self._observed | self._bumps

    def cells(self) -> npt.NDArray[np.uint8]:
        """Return (rows, columns): 0 unknown, 1 free, 2 occupied."""
        return np.where(self.occupied, OCCUPIED, np.where(self._observed, FREE, UNKNOWN)).astype(np.uint8)

    def grid_map(self) -> GridMap:
        """Return the map for the record, cut to what is known."""
        cells = self.cells()
        rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
        if rows.size == 0:
            return GridMap(cells[:1, :1], self.origin_x_m, self.origin_y_m, self.resolution_m)
        top, left = int(rows[0]), int(columns[0])
        return GridMap(
            np.ascontiguousarray(cells[top : rows[-1] + 1, left : columns[-1] + 1]),
            self.origin_x_m + left * self.resolution_m,
            self.origin_y_m + top * self.resolution_m,
            self.resolution_m,
        )

    def cell_at(self, x_m: float, y_m: float) -> Cell:
        """Return the cell of a point; it may lie outside the grid."""
        return Cell(
            math.floor((y_m - self.origin_y_m) / self.resolution_m),
            math.floor((x_m - self.origin_x_m) / self.resolution_m),
        )

    def holds(self, cell: Cell) -> bool:
        """Whether the cell lies in the grid."""
        rows, columns = self._evidence.shape
        return 0 <= cell.row < rows and 0 <= cell.column < columns

    def observe(self, depth_m: npt.NDArray[np.float32], camera: Camera, pose: Pose) -> None:
        """Draw a depth image, taken at `pose`, into the map; invalid depth changes nothing.

        Args:
            depth_m: (H, W) metres along the optical axis, NaN where invalid; any resolution of the camera's view.
            camera: the camera that took it.
            pose: odometry of the base in the frame of the start.
        """
        from vsnbench.sensing.map_kernels import carve, project, weigh

        settings = self._settings
        if not np.isfinite(depth_m).any():
            return
        self._make_room(pose, settings.range_m * math.sqrt(2) + abs(camera.mount_forward_m))
        height, width = depth_m.shape
        top_m = settings.obstacle_top_m if settings.obstacle_top_m is not None else camera.mount_height_m
        rays = camera.rays(width, height)
        mount = np.array([rays.forward_m, rays.height_m])
        where = np.array([pose.x_m, pose.y_m, math.cos(pose.heading_rad), math.sin(pose.heading_rad)])
        grid = np.array([self.origin_x_m, self.origin_y_m, self.resolution_m])
        band = np.array([settings.obstacle_bottom_m, top_m, settings.range_m, settings.obstacle_points])
        hits, floor = np.zeros(self.shape, np.int32), np.zeros(self.shape, np.int32)
        crossed = np.zeros(self.shape, np.uint8)
        reach_m = np.zeros(width)
        project(
            np.ascontiguousarray(depth_m),
            rays.ahead,
            rays.left,
            rays.up,
            mount,
            where,
            grid,
            band,
            hits,
            floor,
            reach_m,
        )
        lowest_rad = -math.atan2(rays.up[-1], rays.ahead[-1])
        drop_m = max(camera.mount_height_m - settings.obstacle_bottom_m, 0.0)
        near_m = drop_m / math.tan(lowest_rad) if lowest_rad > 0 else math.inf
        carve(reach_m, rays.left, mount, where, grid, near_m, crossed)
        weigh(hits, floor, crossed, settings.obstacle_points, self._evidence, self._observed)
        self._clear_robot(pose)

    def mark_obstacle(self, x_m: float, y_m: float, robot: Pose) -> None:
        """Mark a point that the robot ran into, for good; never a cell under the robot itself."""
        self._make_room(Pose(x_m, y_m), 2 * self.resolution_m)
        cell = self.cell_at(x_m, y_m)
        self._bumps[cell.row, cell.column] = True
        self._clear_robot(robot)

    def _clear_robot(self, pose: Pose) -> None:
        """Where the robot stands is free."""
        rows, columns = self._under(pose)
        self._evidence[rows, columns] = np.float32(-1.0)
        self._observed[rows, columns] = True
        self._bumps[rows, columns] = False

    def _under(self, pose: Pose) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        reach = math.ceil(self._settings.robot_radius_m / self.resolution_m)
        cell = self.cell_at(pose.x_m, pose.y_m)
        rows, columns = np.mgrid[cell.row - reach : cell.row + reach + 1, cell.column - reach : cell.column + reach + 1]
        x_m = self.origin_x_m + (columns + 0.5) * self.resolution_m
        y_m = self.origin_y_m + (rows + 0.5) * self.resolution_m
        # Cells wholly under the shell; and its own, however coarse the grid.
        inner_m = self._settings.robot_radius_m - self.resolution_m * math.sqrt(0.5)
        under = np.hypot(x_m - pose.x_m, y_m - pose.y_m) <= inner_m
        under |= (rows == cell.row) & (columns == cell.column)
        height, width = self.shape
        under &= (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
        return rows[under], columns[under]

    def _make_room(self, pose: Pose, reach_m: float) -> None:
        """Grow the grid so that everything within `reach_m` of a pose lies in it."""
        rows, columns = self.shape
        low, high = (
            self.cell_at(pose.x_m - reach_m, pose.y_m - reach_m),
            self.cell_at(pose.x_m + reach_m, pose.y_m + reach_m),
        )
        before = (_blocks(-low.row), _blocks(-low.column))
        after = (_blocks(high.row - rows + 1), _blocks(high.column - columns + 1))
        if not any(before + after):
            return
        widths = ((before[0], after[0]), (before[1], after[1]))
        self._evidence = np.pad(self._evidence, widths)
        self._observed = np.pad(self._observed, widths)
        self._bumps = np.pad(self._bumps, widths)
        self.origin_y_m -= before[0] * self.resolution_m
        self.origin_x_m -= before[1] * self.resolution_m


def _blocks(cells: int) -> int:
    """Return how many cells to grow by to have at least that many more."""
    return max(0, math.ceil(cells / _GROW_CELLS)) * _GROW_CELLS
