"""Occupancy map from depth images and odometry; grows with the known area.

A cell is an obstacle if at least two points of an image are between floor and robot height. Votes of images add up, so
that later images can clear it.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.site_checks.map_walls.grid import FREE, OCCUPIED, UNKNOWN
from vsnbench.values.camera import Camera
from vsnbench.values.decision import GridMap
from vsnbench.values.pose import Pose

_START_HALF_M: Final = 5.0
_GROW_CELLS: Final = 40


@dataclass(frozen=True, slots=True)
class MappingSettings:
    """Settings of an occupancy map."""

    resolution_m: float = 0.05
    """Side length of a cell."""
    range_m: float = 5.0
    """Longest depth that is mapped."""
    obstacle_bottom_m: float = 0.2
    """Lower points are floor."""
    obstacle_top_m: float | None = 1.2
    """Higher points do not obstruct the robot; None for the height of the camera."""
    obstacle_points: int = 2
    """Smallest number of points of an obstacle."""
    robot_radius_m: float = 0.177
    """Cells under the robot are free."""


@dataclass(frozen=True, slots=True)
class MapCell:
    """Indices of a cell; they change when the grid grows."""

    row: int
    column: int


class OccupancyMap:
    """A grid in the frame of the odometry, which begins at the start of the episode."""

    def __init__(self, settings: MappingSettings | None = None) -> None:
        self._settings = settings = settings if settings is not None else MappingSettings()
        self.resolution_m = settings.resolution_m
        side = 2 * math.ceil(_START_HALF_M / self.resolution_m)
        self.origin_x_m = self.origin_y_m = -side / 2 * self.resolution_m
        self._evidence = np.zeros((side, side), np.float32)
        self._observed = np.zeros((side, side), np.bool_)
        self._bumps = np.zeros((side, side), np.bool_)
        self._newest = np.zeros((side, side), np.int32)
        self.images = 0
        """Number of images that were added."""

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        rows, columns = self._evidence.shape
        return (rows, columns)

    @property
    def occupied(self) -> npt.NDArray[np.bool_]:
        """(rows, columns): obstacles, from images or contacts."""
        return (self._observed & (self._evidence > 0)) | self._bumps

    @property
    def known(self) -> npt.NDArray[np.bool_]:
        """(rows, columns): known cells."""
        return self._observed | self._bumps

    def cells(self) -> npt.NDArray[np.uint8]:
        """Return (rows, columns): 0 unknown, 1 free, 2 occupied."""
        return np.where(self.occupied, OCCUPIED, np.where(self._observed, FREE, UNKNOWN)).astype(np.uint8)

    def grid_map(self) -> GridMap:
        """Return the map for the record, cropped to known cells."""
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

    def cell_at(self, x_m: float, y_m: float) -> MapCell:
        """Return the cell of a point; it may be outside the grid."""
        return MapCell(
            math.floor((y_m - self.origin_y_m) / self.resolution_m),
            math.floor((x_m - self.origin_x_m) / self.resolution_m),
        )

    def holds(self, cell: MapCell) -> bool:
        """Return whether a cell is in the grid."""
        rows, columns = self._evidence.shape
        return 0 <= cell.row < rows and 0 <= cell.column < columns

    def window(self, low: MapCell, high: MapCell) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Return which cells of a rectangle, corners included, are obstacles, and which are known.

        Cells outside the grid are neither.
        """
        shape = high.row - low.row + 1, high.column - low.column + 1
        occupied, known = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
        top, left = max(low.row, 0), max(low.column, 0)
        bottom, right = min(high.row + 1, self.shape[0]), min(high.column + 1, self.shape[1])
        if top < bottom and left < right:
            there = slice(top, bottom), slice(left, right)
            here = slice(top - low.row, bottom - low.row), slice(left - low.column, right - low.column)
            bumps, observed = self._bumps[there], self._observed[there]
            occupied[here] = (observed & (self._evidence[there] > 0)) | bumps
            known[here] = observed | bumps
        return occupied, known

    def observe(self, depth_m: npt.NDArray[np.float32], camera: Camera, pose: Pose) -> None:
        """Add a depth image to the map; invalid depth changes nothing.

        Args:
            depth_m: (H, W) metres along the optical axis, NaN where invalid; any resolution of the camera's view.
            camera: camera of the image.
            pose: odometry of the base at the image.
        """
        from vsnbench.sensing.map_kernels import carve, project, weigh

        settings = self._settings
        self.images += 1
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
        points = settings.obstacle_points
        weigh(hits, floor, crossed, points, self.images, self._evidence, self._observed, self._newest)
        self._clear_robot(pose)

    def forget_before(self, image: int) -> None:
        """Forget the cells that no image has shown since an earlier one.

        Args:
            image: number of the oldest image that counts; the first one is 1.
        """
        old = self._newest < image
        self._evidence[old] = 0.0
        self._observed[old] = False

    def mark_obstacle(self, x_m: float, y_m: float, robot: Pose) -> None:
        """Mark the point of a contact permanently, unless it is under the robot."""
        self._make_room(Pose(x_m, y_m), 2 * self.resolution_m)
        cell = self.cell_at(x_m, y_m)
        self._bumps[cell.row, cell.column] = True
        self._clear_robot(robot)

    def _clear_robot(self, pose: Pose) -> None:
        """Mark the cells under the robot as free."""
        rows, columns = self._under(pose)
        self._evidence[rows, columns] = np.float32(-1.0)
        self._observed[rows, columns] = True
        self._bumps[rows, columns] = False
        self._newest[rows, columns] = self.images

    def _under(self, pose: Pose) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        reach = math.ceil(self._settings.robot_radius_m / self.resolution_m)
        cell = self.cell_at(pose.x_m, pose.y_m)
        rows, columns = np.mgrid[cell.row - reach : cell.row + reach + 1, cell.column - reach : cell.column + reach + 1]
        x_m = self.origin_x_m + (columns + 0.5) * self.resolution_m
        y_m = self.origin_y_m + (rows + 0.5) * self.resolution_m
        # Cells that are entirely under the robot, and the cell of its centre.
        inner_m = self._settings.robot_radius_m - self.resolution_m * math.sqrt(0.5)
        under = np.hypot(x_m - pose.x_m, y_m - pose.y_m) <= inner_m
        under |= (rows == cell.row) & (columns == cell.column)
        height, width = self.shape
        under &= (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
        return rows[under], columns[under]

    def _make_room(self, pose: Pose, reach_m: float) -> None:
        """Grow the grid to contain everything within `reach_m` of a pose."""
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
        self._newest = np.pad(self._newest, widths)
        self.origin_y_m -= before[0] * self.resolution_m
        self.origin_x_m -= before[1] * self.resolution_m


def _blocks(cells: int) -> int:
    """Return the number of cells to add, in blocks, for at least `cells` more."""
    return max(0, math.ceil(cells / _GROW_CELLS)) * _GROW_CELLS
