"""The depth guard to the side, where no camera looks: what the images of the last metres have shown there."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.parameters import DepthGuard, ProtocolParameters
from vsnbench.runner.episode.depth_guard import GuardReading, Refusal
from vsnbench.sensing.occupancy_map import MappingSettings, OccupancyMap
from vsnbench.values.camera import Camera
from vsnbench.values.movement import Drive, Sidestep, Velocity, goes_sideways
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

REMEMBERED_M: Final = 2.0
"""Way since an image after which it is forgotten: odometry that drifts by 5 % is off by 10 cm then."""
_REMEMBERED: Final = 60
_COLUMNS: Final = 160
"""Columns of a remembered image: 2 cm apart at 3 m in a view of 90°."""
_RANGE_M: Final = 3.0
_CELL_M: Final = 0.05
_NEARER_M: Final = 0.01
_STEP_S: Final = 0.1
_Cells = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    depth_m: npt.NDArray[np.float32]
    camera: Camera
    pose: Pose
    way_m: float
    """Length of the way to this look."""


class SideGuard:
    """Remembers the depth images of one episode, and checks sidesteps against them.

    A sidestep is refused if an obstacle was seen where the robot would go, with the protocol's margins: those of a
    forward move, turned to the side. It is also refused if a part of its way was never seen that is large enough for an
    obstacle: a square of 10 cm. A robot can turn to look there, or come from where its camera saw it.

    The same holds for a velocity with a part to the side. Obstacles do not count if the robot does not come nearer.
    """

    def __init__(self, base: Base, parameters: ProtocolParameters) -> None:
        self._base = base
        self._guard: DepthGuard = parameters.depth_guard
        self._clearance_m = max(self._guard.distance_m - parameters.forward_m, 0.05)
        self._looks: deque[_Look] = deque(maxlen=_REMEMBERED)

    def look(self, observation: Observation) -> None:
        """Remember the depth image before an action."""
        if observation.depth_m is None or not self._guard.enabled:
            return
        step = max(1, observation.depth_m.shape[1] // _COLUMNS)
        depth_m = np.ascontiguousarray(observation.depth_m[step // 2 :: step, step // 2 :: step])
        pose = observation.pose
        way_m = self._looks[-1].way_m + pose.distance_to(self._looks[-1].pose) if self._looks else 0.0
        self._looks.append(_Look(depth_m, observation.camera, pose, way_m))
        while way_m - self._looks[0].way_m > REMEMBERED_M:
            self._looks.popleft()

    def reading_of(self, movement: Drive) -> GuardReading:
        """Return whether a movement from the last look must be refused; only those to the side are checked."""
        match movement:
            case Sidestep(left_m):
                return self.reading(left_m)
            case Velocity() if goes_sideways(movement):
                return self._reading_along(movement)
        return GuardReading()

    def _reading_along(self, velocity: Velocity) -> GuardReading:
        """Return whether a velocity must be refused."""
        if not self._looks:
            return GuardReading()
        grid, (ahead_m, left_m) = self._cells()
        side = "left" if velocity.lateral_m_s >= 0 else "right"
        way = _way(velocity)
        radius_m = self._base.radius_m
        last = way[-1]
        speed_m_s = velocity.speed_m_s
        beyond = Pose(
            self._clearance_m * velocity.linear_m_s / speed_m_s, self._clearance_m * velocity.lateral_m_s / speed_m_s
        )
        now_m = np.hypot(ahead_m, left_m)
        driven_m = _distance_m(way, ahead_m, left_m)
        nearest_m = np.minimum(driven_m, _distance_m([last.compose(beyond)], ahead_m, left_m))
        approached = (nearest_m <= radius_m + self._guard.margin_m) & (nearest_m < now_m - _NEARER_M)
        obstacles = grid.occupied & approached
        if obstacles.any():
            free_m = max(float(now_m[obstacles].min()) - radius_m, 0.0)
            return GuardReading(Refusal.OBSTACLE, int(np.count_nonzero(obstacles)), free_m, side=side)
        return self._unseen(grid, driven_m <= radius_m, side)

    def _unseen(self, grid: OccupancyMap, swept: npt.NDArray[np.bool_], side: str) -> GuardReading:
        """Return whether the cells that the robot will cover have a part that was never seen."""
        unseen = swept & ~grid.known
        if (unseen[:-1, :-1] & unseen[1:, :-1] & unseen[:-1, 1:] & unseen[1:, 1:]).any():
            share = 1.0 - float(np.count_nonzero(unseen) / np.count_nonzero(swept))
            return GuardReading(Refusal.UNSEEN, valid_share=share, side=side)
        return GuardReading(side=side)

    def _cells(self) -> tuple[OccupancyMap, tuple[_Cells, _Cells]]:
        """Return the map, and how far each of its cells lies ahead of the robot and to its left, metres."""
        here, grid = self._looks[-1].pose, self._map()
        rows, columns = grid.shape
        x_m = grid.origin_x_m + (np.arange(columns) + 0.5) * grid.resolution_m - here.x_m
        y_m = grid.origin_y_m + (np.arange(rows)[:, None] + 0.5) * grid.resolution_m - here.y_m
        cos, sin = math.cos(here.heading_rad), math.sin(here.heading_rad)
        return grid, (x_m * cos + y_m * sin, y_m * cos - x_m * sin)

    def reading(self, left_m: float) -> GuardReading:
        """Return whether a sidestep from the last look must be refused; never for a robot without depth images.

        Args:
            left_m: distance to the left, negative to the right.
        """
        if not self._looks:
            return GuardReading()
        side = "left" if left_m >= 0 else "right"
        grid, (along_m, to_left_m) = self._cells()
        ahead_m, aside_m = np.abs(along_m), math.copysign(1.0, left_m) * to_left_m
        radius_m, distance_m = self._base.radius_m, abs(left_m)
        box = (ahead_m <= radius_m + self._guard.margin_m) & (aside_m >= 0.0)
        obstacles = grid.occupied & box & (aside_m <= radius_m + distance_m + self._clearance_m)
        if obstacles.any():
            nearest_m = float(aside_m[obstacles].min()) - radius_m
            return GuardReading(Refusal.OBSTACLE, int(np.count_nonzero(obstacles)), nearest_m, side=side)
        swept = np.hypot(ahead_m, aside_m - np.clip(aside_m, 0.0, distance_m)) <= radius_m
        return self._unseen(grid, swept, side)

    def _map(self) -> OccupancyMap:
        """Return a map of what the remembered images show, older ones first."""
        settings = MappingSettings(
            resolution_m=_CELL_M,
            range_m=_RANGE_M,
            obstacle_bottom_m=self._guard.min_height_m,
            obstacle_top_m=self._guard.max_height_m,
            robot_radius_m=self._base.radius_m,
        )
        grid = OccupancyMap(settings)
        for look in self._looks:
            grid.observe(look.depth_m, look.camera, look.pose)
        return grid


def _way(velocity: Velocity) -> list[Pose]:
    """Return poses along a velocity, in the robot's frame at its begin; ramps, which make it shorter, are left out."""
    count = max(math.ceil(velocity.duration_s / _STEP_S), 1)
    step_s = velocity.duration_s / count
    turn_rad = velocity.angular_rad_s * step_s
    half = Pose(0.0, 0.0, turn_rad / 2)
    way = [Pose(0.0, 0.0)]
    for _ in range(count):
        middle = way[-1].compose(half)
        moved = middle.compose(Pose(velocity.linear_m_s * step_s, velocity.lateral_m_s * step_s))
        way.append(moved.compose(half))
    return way


def _distance_m(way: list[Pose], ahead_m: _Cells, left_m: _Cells) -> _Cells:
    """Return the distance of each cell from the nearest of some poses."""
    nearest_m: _Cells = np.full(np.broadcast_shapes(ahead_m.shape, left_m.shape), np.inf)
    for pose in way:
        np.minimum(nearest_m, np.hypot(ahead_m - pose.x_m, left_m - pose.y_m), out=nearest_m)
    return nearest_m
