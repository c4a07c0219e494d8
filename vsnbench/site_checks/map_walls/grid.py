"""Occupancy grid of a floor plan, from a robot's map or an image."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.values.pose import Pose

UNKNOWN, FREE, OCCUPIED = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class PlanGrid:
    """Cells of a floor plan; row 0 is the lowest row, column 0 the leftmost column."""

    cells: npt.NDArray[np.uint8]
    """(rows, columns): 0 unknown, 1 free, 2 occupied."""
    resolution_m: float
    origin: Pose
    """Lower left corner of the lower left cell, and heading of the grid's columns, in the site's frame."""

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height, metres."""
        rows, columns = self.cells.shape
        return columns * self.resolution_m, rows * self.resolution_m

    def in_site(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return (n, 2) points, given as column and row from the grid's corner, in metres of the site's frame."""
        cos, sin = math.cos(self.origin.heading_rad), math.sin(self.origin.heading_rad)
        turned = points * self.resolution_m @ np.array([[cos, sin], [-sin, cos]])
        return np.asarray(turned + np.array(self.origin.position), np.float64)

    def cells_at(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
        """Return the (n,) cells at (n, 2) points of the site's frame; `UNKNOWN` outside the grid."""
        cos, sin = math.cos(self.origin.heading_rad), math.sin(self.origin.heading_rad)
        own = (points - np.array(self.origin.position)) @ np.array([[cos, -sin], [sin, cos]]) / self.resolution_m
        columns, rows = np.floor(own).astype(np.int64).T
        height, width = self.cells.shape
        inside = (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
        cells = self.cells[rows.clip(0, height - 1), columns.clip(0, width - 1)]
        return np.where(inside, cells, UNKNOWN).astype(np.uint8)

    def picture(self) -> npt.NDArray[np.uint8]:
        """Return (rows, columns) grey values of ROS's map_server, highest row first."""
        grey = np.array([205, 254, 0], np.uint8)
        return np.ascontiguousarray(np.flipud(grey[self.cells]))
