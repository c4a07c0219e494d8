"""The depth guard to the side, where no camera looks: what the images of the last metres have shown there."""

import math
from typing import Final

import numpy as np

from vsnbench.protocol.parameters import DepthGuard, ProtocolParameters
from vsnbench.runner.episode.depth_guard import GuardReading, Refusal
from vsnbench.runner.episode.local_map import LocalMap
from vsnbench.values.movement import Drive, Sidestep, Velocity
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

_UNSEEN_M: Final = 0.1
"""Side of the smallest square that can hide an obstacle."""
_STEP_S: Final = 0.1


class SideGuard:
    """Checks movements to the side against the local map.

    A sidestep is refused if an obstacle was seen where the robot would go, with the protocol's margins: those of a
    forward move, turned to the side. It is also refused if a part of its way was never seen that is large enough for an
    obstacle: a square of 10 cm. A robot can turn to look there, or come from where its camera saw it.

    The same holds for a velocity with a part to the side. Obstacles do not count if the robot does not come nearer.
    """

    def __init__(self, base: Base, parameters: ProtocolParameters, local_map: LocalMap) -> None:
        self._base = base
        self._guard: DepthGuard = parameters.depth_guard
        self._clearance_m = max(self._guard.distance_m - parameters.forward_m, 0.05)
        self._map = local_map

    def reading_of(self, movement: Drive) -> GuardReading:
        """Return whether a movement from the newest image must be refused; only those to the side are checked."""
        match movement:
            case Sidestep(left_m):
                return self.reading(left_m)
            case Velocity() if movement.goes_sideways:
                return self._reading_along(movement)
        return GuardReading()

    def _reading_along(self, velocity: Velocity) -> GuardReading:
        """Return whether a velocity must be refused."""
        if self._map.pose is None:
            return GuardReading()
        side = "left" if velocity.lateral_m_s >= 0 else "right"
        way = _way(velocity)
        radius_m, speed_m_s = self._base.radius_m, velocity.speed_m_s
        beyond = Pose(
            self._clearance_m * velocity.linear_m_s / speed_m_s, self._clearance_m * velocity.lateral_m_s / speed_m_s
        )
        end = way[-1].compose(beyond)
        within_m = radius_m + self._guard.margin_m
        reach_m = within_m + max(math.hypot(*pose.position) for pose in (*way, end))
        cells = self._map.around(self._map.pose, reach_m)
        obstacles = cells.approached([*way, end], within_m)
        if obstacles.any():
            return cells.met(obstacles, radius_m, side)
        return cells.unseen(cells.distance_m(way) <= radius_m, _UNSEEN_M, side)

    def reading(self, left_m: float) -> GuardReading:
        """Return whether a sidestep from the newest image must be refused; never for a robot without depth images.

        Args:
            left_m: distance to the left, negative to the right.
        """
        if self._map.pose is None:
            return GuardReading()
        side = "left" if left_m >= 0 else "right"
        radius_m, distance_m = self._base.radius_m, abs(left_m)
        far_m = radius_m + distance_m + self._clearance_m
        cells = self._map.around(self._map.pose, math.hypot(far_m, radius_m + self._guard.margin_m))
        ahead_m, aside_m = np.abs(cells.ahead_m), math.copysign(1.0, left_m) * cells.left_m
        box = (ahead_m <= radius_m + self._guard.margin_m) & (aside_m >= 0.0)
        obstacles = cells.occupied & box & (aside_m <= far_m)
        if obstacles.any():
            nearest_m = float(aside_m[obstacles].min()) - radius_m
            return GuardReading(Refusal.OBSTACLE, int(np.count_nonzero(obstacles)), nearest_m, side=side)
        swept = np.hypot(ahead_m, aside_m - np.clip(aside_m, 0.0, distance_m)) <= radius_m
        return cells.unseen(swept, _UNSEEN_M, side)


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
