"""A map of the floor from depth images: what is free, what is solid, where the unknown begins, and paths over it.

The explorers in examples/ share it: frontier.py, instruction.py and image_goal.py.
"""

from typing import Any

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from vsnbench import Observation

CELL_M, CELLS = 0.05, 512
CENTRES = (np.arange(CELLS) - CELLS / 2 + 0.5) * CELL_M
POINTS = (CENTRES + 1j * CENTRES[:, None]).ravel()  # x + iy of all cells, in the frame of the odometry
STEPS = np.array((1, CELLS, CELLS + 1, CELLS - 1))  # from a cell to half of its neighbours
LENGTHS_M = CELL_M * np.sqrt((1, 1, 2, 2))
REACH_M = 5.0  # farther depth is ignored


def cells(points: Any) -> Any:
    """Return the indices of the cells of points."""
    rows, columns = (np.clip(k // CELL_M + CELLS // 2, 1, CELLS - 2) for k in (np.imag(points), np.real(points)))
    return (rows * CELLS + columns).astype(int)


class DepthMap:
    """A grid of cells, with the robot's position `here` and its direction `ahead` as complex numbers."""

    def __init__(self, radius_m: float) -> None:
        """Make an empty map for a robot."""
        self.radius_m = radius_m
        self.here, self.ahead = complex(np.inf), complex(1.0)
        self.seen, self.solid = np.zeros((2, CELLS**2), bool)
        self.refused = np.zeros(CELLS**2)  # number of times that the depth guard refused to drive there

    def look(self, observation: Observation) -> tuple[complex, Any]:
        """Add an observation.

        Returns:
            The position of the lens, and the way from it to what each pixel of every other row and column shows; 0
            where the depth is invalid.
        """
        before = self.here, self.ahead
        self.here = complex(observation.pose.x_m, observation.pose.y_m)
        self.ahead = complex(np.exp(1j * observation.pose.heading_rad))
        self.way = (POINTS - self.here) / self.ahead  # from the robot, in its own frame
        if abs(self.here - before[0]) + abs(self.ahead - before[1]) < CELL_M:
            self.refused[abs(self.way - self.radius_m - 0.05) < 0.15] += 1
        if observation.depth_m is None:
            raise ValueError("the card must ask for depth")
        camera, depth_m = observation.camera, observation.depth_m[::2, ::2]
        x_m, y_m, z_m = np.moveaxis(camera.points_in_base(depth_m), 2, 0)
        lens = self.here + self.ahead * camera.mount_forward_m
        rays = self.ahead * np.nan_to_num(x_m - camera.mount_forward_m + 1j * y_m)
        range_m = abs(rays)
        solid = (z_m > 0.05) & (z_m < 1.2) & (range_m < REACH_M)
        self.solid[cells(lens + rays[solid])] = True
        free_m = np.minimum(np.where(solid, range_m, REACH_M).min(axis=0), range_m.max(axis=0)) - CELL_M
        columns = self.ahead * np.exp(1j * np.arctan(camera.rays(depth_m.shape[1], depth_m.shape[0]).left))
        along_m = np.arange(0.0, REACH_M, CELL_M / 2)[:, None]
        self.seen[cells((lens + along_m * columns)[along_m < free_m])] = True
        # What is still unknown at the robot or right ahead of it is taken for free: the camera cannot show it.
        self.seen |= (abs(self.way) < 0.3) | ((abs(self.way) < 0.6) & (abs(np.angle(self.way)) < 0.3))
        self.clearance_m = CELL_M * ndimage.distance_transform_edt(~self.solid.reshape(CELLS, CELLS)).ravel()
        self.roomy = self.clearance_m > self.radius_m + 0.06
        self.open = self.seen & ~self.solid & (self.refused < 3) & (self.roomy | (abs(self.way) < 0.3))
        return lens, rays

    def frontier(self) -> Any:
        """Return which cells touch what is unknown; holes of one or two cells do not count."""
        unknown = ndimage.binary_opening((~self.seen & ~self.solid).reshape(CELLS, CELLS), np.ones((3, 3), bool))
        return ndimage.binary_dilation(unknown).ravel()

    def path(self, ends: Any) -> list[int]:
        """Return the cells of the cheapest path to one of `ends`; empty if none is reachable."""
        # Rather through the middle of a door, and not where the depth guard refused to drive.
        cost = 1 + (0.3 / np.maximum(self.clearance_m, CELL_M)) ** 2 + 100 * self.refused
        first = np.flatnonzero(self.open)[:, None] + 0 * STEPS
        both = self.open[first + STEPS]
        edges = first[both], (first + STEPS)[both]
        graph = csr_array(((LENGTHS_M * cost[first])[both], edges), shape=(CELLS**2, CELLS**2))
        ends = np.flatnonzero(ends & self.open & self.roomy)
        self.cost_m, following, _ = dijkstra(
            graph, directed=False, indices=ends, return_predecessors=True, min_only=True
        )
        path = [int(cells(self.here))]
        while following[path[-1]] >= 0:
            path.append(int(following[path[-1]]))
        return path if np.isfinite(self.cost_m[path[0]]) else []

    def straight(self, path: list[int]) -> complex:
        """Return the way to the farthest cell of a path that is straight ahead over open cells, at most 2.8 m."""
        clear = self.open & (self.refused == 0)
        ends = (k for k in path[40:0:-1] if clear[cells(np.linspace(self.here, POINTS[k], 200))].all())
        return complex(self.way[next(ends, path[:6][-1])])
