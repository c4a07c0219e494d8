"""The local map of an episode: what the depth images of the last metres have shown around the robot."""

import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.parameters import DepthGuard
from vsnbench.runner.episode.depth_guard import GuardReading, Refusal
from vsnbench.sensing.occupancy_map import MappingSettings, OccupancyMap
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

REMEMBERED_M: Final = 2.0
"""Way since an image after which it is forgotten: odometry that drifts by 5 % is off by 10 cm then."""
_CELL_M: Final = 0.02
_COLUMNS: Final = 160
"""Columns of an image that are mapped: a cell apart at the range in a view of 60°."""
_RANGE_M: Final = 3.0
_NEARER_M: Final = 0.01
_Cells = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The cells of a local map around a pose, as arrays (rows, columns)."""

    occupied: npt.NDArray[np.bool_]
    known: npt.NDArray[np.bool_]
    ahead_m: _Cells
    """Distance ahead of the pose."""
    left_m: _Cells
    """Distance to its left."""

    def distance_m(self, way: Sequence[Pose]) -> _Cells:
        """Return the distance of each cell from the nearest of some poses, which are relative to the pose."""
        nearest_m2: _Cells = np.full(self.occupied.shape, np.inf)
        for pose in way:
            np.minimum(nearest_m2, (self.ahead_m - pose.x_m) ** 2 + (self.left_m - pose.y_m) ** 2, out=nearest_m2)
        return np.sqrt(nearest_m2)

    def approached(self, way: Sequence[Pose], within_m: float) -> npt.NDArray[np.bool_]:
        """Return the obstacles that come nearer than a distance along a way, and nearer than they are now."""
        nearest_m = self.distance_m(way)
        nearer = nearest_m < np.hypot(self.ahead_m, self.left_m) - _NEARER_M
        return np.asarray(self.occupied & (nearest_m <= within_m) & nearer)

    def met(self, obstacles: npt.NDArray[np.bool_], radius_m: float, side: str) -> GuardReading:
        """Return that a robot of a radius meets some obstacles, and how far it is from the nearest."""
        free_m = max(float(np.hypot(self.ahead_m, self.left_m)[obstacles].min()) - radius_m, 0.0)
        return GuardReading(Refusal.OBSTACLE, int(np.count_nonzero(obstacles)), free_m, side=side)

    def unseen(self, where: npt.NDArray[np.bool_], width_m: float, side: str) -> GuardReading:
        """Return whether some cells contain a square of a width that no image has shown, which is refused."""
        hidden, count = where & ~self.known, math.ceil(width_m / _CELL_M - 1e-6)
        squares = np.lib.stride_tricks.sliding_window_view(hidden, (count, count))
        if squares.all(axis=(2, 3)).any():
            share = np.count_nonzero(where & self.known) / np.count_nonzero(where)
            return GuardReading(Refusal.UNSEEN, valid_share=float(share), side=side)
        return GuardReading(side=side)


class LocalMap:
    """Maps the depth images of one episode, in the frame of its odometry; an image is forgotten 2 m later.

    One thread can take images while another reads.
    """

    def __init__(self, profile: RobotProfile, guard: DepthGuard) -> None:
        self._enabled = guard.enabled
        settings = MappingSettings(
            resolution_m=_CELL_M,
            range_m=_RANGE_M,
            obstacle_bottom_m=guard.min_height_m,
            obstacle_top_m=guard.max_height_m,
            robot_radius_m=profile.base.radius_m,
        )
        self._map = OccupancyMap(settings)
        self._lock = threading.Lock()
        self._ways: deque[tuple[int, float]] = deque()
        """Number of each image that counts, and the length of the way to it."""
        self._stamp_s = -math.inf
        self.pose: Pose | None = None
        """Odometry at the newest image; None before the first."""
        loading = OccupancyMap(settings)  # compiles the code before the robot drives
        loading.observe(np.ones((2, 2), np.float32), profile.camera.without_roll, Pose(0.0, 0.0))

    def observe(self, observation: Observation) -> None:
        """Add the depth image of an observation."""
        if observation.depth_m is not None:
            stamp_s = observation.stamp_s if observation.depth_stamp_s is None else observation.depth_stamp_s
            self.add(observation.depth_m, observation.camera, observation.pose, stamp_s)

    def add(self, depth_m: npt.NDArray[np.float32], camera: Camera, pose: Pose, stamp_s: float) -> None:
        """Add a depth image, unless a newer one is there already.

        Args:
            depth_m: (H, W) metres, NaN where invalid.
            camera: camera of the image.
            pose: odometry at its capture, relative to the start of the episode.
            stamp_s: time of its capture, on the robot's clock.
        """
        if not self._enabled:
            return
        step = max(1, depth_m.shape[1] // _COLUMNS)
        with self._lock:
            if stamp_s <= self._stamp_s:
                return
            way_m = 0.0 if self.pose is None else self._ways[-1][1] + pose.distance_to(self.pose)
            self._stamp_s, self.pose = stamp_s, pose
            self._map.observe(np.ascontiguousarray(depth_m[step // 2 :: step, step // 2 :: step]), camera, pose)
            self._ways.append((self._map.images, way_m))
            forgotten = False
            while way_m - self._ways[0][1] > REMEMBERED_M:
                self._ways.popleft()
                forgotten = True
            if forgotten:
                self._map.forget_before(self._ways[0][0])

    def around(self, pose: Pose, reach_m: float) -> Surroundings:
        """Return the cells within a square around a pose.

        Args:
            pose: pose in the frame of the odometry.
            reach_m: half of the side of the square.
        """
        with self._lock:
            return self._around(pose, reach_m)

    def _around(self, pose: Pose, reach_m: float) -> Surroundings:
        grid = self._map
        low = grid.cell_at(pose.x_m - reach_m, pose.y_m - reach_m)
        high = grid.cell_at(pose.x_m + reach_m, pose.y_m + reach_m)
        rows, columns = np.arange(low.row, high.row + 1), np.arange(low.column, high.column + 1)
        x_m = grid.origin_x_m + (columns + 0.5) * grid.resolution_m - pose.x_m
        y_m = grid.origin_y_m + (rows[:, None] + 0.5) * grid.resolution_m - pose.y_m
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        occupied, known = grid.window(low, high)
        return Surroundings(occupied, known, x_m * cos + y_m * sin, y_m * cos - x_m * sin)
