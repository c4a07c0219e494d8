"""An occupancy grid seen from above: what a robot's map, a scan and a picture of a plan have in common."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.pose import Pose

UNKNOWN, FREE, OCCUPIED = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class PlanGrid:
    """Cells of a floor plan; row 0 is the lowest, column 0 the leftmost."""

    cells: npt.NDArray[np.uint8]
    """(rows, columns): 0 unknown, 1 free, 2 occupied."""
    resolution_m: float
    origin: Pose
    """The lower left corner of the lower left cell in the site's frame, and how the grid is turned there."""

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
        """Return what the grid says at (n, 2) points of the site's frame; outside it nothing is known."""
        cos, sin = math.cos(self.origin.heading_rad), math.sin(self.origin.heading_rad)
        own = (points - np.array(self.origin.position)) @ np.array([[cos, -sin], [sin, cos]]) / self.resolution_m
        columns, rows = np.floor(own).astype(np.int64).T
        height, width = self.cells.shape
        inside = (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
        said = self.cells[rows.clip(0, height - 1), columns.clip(0, width - 1)]
        return np.where(inside, said, UNKNOWN).astype(np.uint8)

    def picture(self) -> npt.NDArray[np.uint8]:
        """Return (rows, columns) grey values as ROS's map_server shows them, the highest row first."""
        grey = np.array([205, 254, 0], np.uint8)
        return np.ascontiguousarray(np.flipud(grey[self.cells]))
