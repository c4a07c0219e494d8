"""Shortest paths from every pose of a site: the cost to go, computed backwards over the oracle's lattice.

Perturbed demonstrations and DAgger need the expert's action at every pose, and a new plan for each would take more time
than everything else. Allowed moves, costs and target views are the oracle's.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.baselines.goal_views import ViewCriteria, target_poses, target_view_points
from vsnbench.models.baselines.lattice_planner import LatticePlanner, NeededSpace
from vsnbench.models.baselines.oracle import HALF_VIEW_DEG, STOP_WITHIN_M
from vsnbench.protocol.free_space import RESOLUTION_M, FreeSpace
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runtime.numba_cache import compiled
from vsnbench.sites.site import SiteObject
from vsnbench.sites.targets import Target
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

TICKS: Final = 4
"""Costs are multiples of a quarter of a move."""
UNREACHED: Final = 2**30
_SPARE_M = 0.03


class Lattice:
    """Allowed moves in one site, over headings that differ by whole turns."""

    def __init__(self, space: FreeSpace, base_heading_rad: float) -> None:
        rules = ProtocolParameters()
        guard = rules.depth_guard
        self.space = space
        self.turn_rad = math.radians(rules.turn_deg)
        self.forward_m = rules.forward_m
        clearance = NeededSpace(space.robot_radius_m, _SPARE_M, guard.distance_m + 0.02, guard.margin_m + 0.01)
        self.planner = LatticePlanner(space, base_heading_rad, rules.forward_m, self.turn_rad, clearance)
        self.may_move = self.planner.allowed_moves
        self.move_ticks = np.rint(TICKS * (1.0 + self.planner.extra_cost)).astype(np.int64)
        steps = [self.planner.heading_rad(k) for k in range(self.planner.headings)]
        self.offsets = np.array(
            [
                [round(self.forward_m * math.sin(h) / RESOLUTION_M), round(self.forward_m * math.cos(h) / RESOLUTION_M)]
                for h in steps
            ]
        )

    def cell_of(self, pose: Pose) -> tuple[int, int, int]:
        """Return (heading, row, column)."""
        return (self.planner.nearest_heading(pose.heading_rad), *self.space.cell_of(*pose.position))

    def after(self, pose: Pose, action: Action) -> Pose:
        """Return the result of an action; a forward move that is not allowed does not move, as with the depth guard."""
        if action is Action.MOVE_FORWARD:
            return pose.compose(Pose(self.forward_m, 0.0)) if self.may_move[self.cell_of(pose)] else pose
        if action.turns:
            return pose.compose(Pose(0.0, 0.0, self.turn_rad if action is Action.TURN_LEFT else -self.turn_rad))
        return pose


class Guide:
    """Best actions from any pose of a site to the nearest of some target poses."""

    def __init__(self, lattice: Lattice, wanted: npt.NDArray[np.bool_]) -> None:
        """Prepare the target poses, (headings, rows, columns)."""
        self._lattice = lattice
        self.ticks = _solve(wanted, lattice.may_move, lattice.move_ticks, lattice.offsets)
        """(headings, rows, columns) cost to a target pose in quarters of a move, or `UNREACHED`."""

    def ticks_from(self, pose: Pose) -> int:
        """Return the cost from a pose, or `UNREACHED`."""
        return int(self.ticks[self._lattice.cell_of(pose)])

    def action_at(self, pose: Pose) -> Action | None:
        """Return the best action, STOP at a target pose; None without a path."""
        lattice = self._lattice
        k, row, column = lattice.cell_of(pose)
        here = int(self.ticks[k, row, column])
        if here >= UNREACHED:
            return None
        if here == 0:
            return Action.STOP
        headings = lattice.planner.headings
        costs = {
            Action.TURN_LEFT: TICKS + int(self.ticks[(k + 1) % headings, row, column]),
            Action.TURN_RIGHT: TICKS + int(self.ticks[(k - 1) % headings, row, column]),
        }
        if lattice.may_move[k, row, column]:
            # Use the cell of the solution: the true result may round to another cell, and with its cost a pose could
            # turn left and right forever.
            ahead = (row + int(lattice.offsets[k, 0]), column + int(lattice.offsets[k, 1]))
            costs[Action.MOVE_FORWARD] = int(lattice.move_ticks[ahead]) + int(self.ticks[k, *ahead])
        return min(costs, key=lambda action: costs[action])


def guide_to_instance(lattice: Lattice, instance: SiteObject, eye_height_m: float) -> Guide:
    """Return the paths to where the oracle would stop for one instance of a goal."""
    target = Target(instance.id, instance.shape, instance)
    points = target_view_points(lattice.space, target, ViewCriteria(STOP_WITHIN_M, eye_height_m))
    return Guide(lattice, target_poses(lattice.space, lattice.planner, points, math.radians(HALF_VIEW_DEG)))


def guide_to_place(lattice: Lattice, row: int, column: int, within_m: float) -> Guide:
    """Return the paths to the surroundings of a cell of the free space, with any final heading."""
    space = lattice.space
    here = np.hypot(space.x_m - space.x_m[row, column], space.y_m - space.y_m[row, column]) <= within_m
    return Guide(lattice, np.repeat((space.cells & here)[None], lattice.planner.headings, axis=0))


@compiled
def _solve(
    wanted: npt.NDArray[np.bool_],
    may_move: npt.NDArray[np.bool_],
    move_ticks: npt.NDArray[np.int64],
    offsets: npt.NDArray[np.int64],
) -> npt.NDArray[np.int32]:
    """Return the cost to go by a search outwards from the target poses, in buckets of equal cost."""
    headings, rows, columns = wanted.shape
    area = rows * columns
    buckets = int(move_ticks.max()) + 1
    cost = np.full(headings * area, UNREACHED, np.int32)
    heads = np.full(buckets, -1, np.int64)
    capacity = 4 * headings * area + 1
    following = np.empty(capacity, np.int64)
    held = np.empty(capacity, np.int64)
    pushes = 0
    for k in range(headings):
        for row in range(rows):
            for column in range(columns):
                if wanted[k, row, column]:
                    state = k * area + row * columns + column
                    cost[state] = 0
                    held[pushes], following[pushes] = state, heads[0]
                    heads[0] = pushes
                    pushes += 1
    level, idle = 0, 0
    while idle < buckets:
        bucket = level % buckets
        entry = heads[bucket]
        heads[bucket] = -1
        idle = idle + 1 if entry < 0 else 0
        while entry >= 0:
            state = held[entry]
            entry = following[entry]
            if cost[state] != level:
                continue
            k, cell = state // area, state % area
            row, column = cell // columns, cell % columns
            for choice in range(3):
                if choice == 2:
                    from_row, from_column = row - offsets[k, 0], column - offsets[k, 1]
                    if not (0 <= from_row < rows and 0 <= from_column < columns):
                        continue
                    if not may_move[k, from_row, from_column]:
                        continue
                    before = k * area + from_row * columns + from_column
                    price = move_ticks[row, column]
                else:
                    before = (k + 1 - 2 * choice + headings) % headings * area + cell
                    price = TICKS
                if level + price < cost[before] and pushes < capacity:
                    cost[before] = level + price
                    held[pushes], following[pushes] = before, heads[(level + price) % buckets]
                    heads[(level + price) % buckets] = pushes
                    pushes += 1
        level += 1
    return cost.reshape(headings, rows, columns)
