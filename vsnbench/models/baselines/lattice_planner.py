"""Plans discrete actions on a site's map: the fewest moves and turns to one of several target poses."""

import heapq
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.free_space import RESOLUTION_M, BoolGrid, FreeSpace, distance_field_m
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

_NARROW_M = 0.15
"""Moves with less spare width than this on a side cost extra, so that the path passes doors in the middle."""
_NARROW_COST = 1.5
_FORBIDDEN_WITHIN_M = 0.10
_MAX_EXPANSIONS = 200_000


@dataclass(frozen=True, slots=True)
class NeededSpace:
    """Free space that a forward move needs, in metres: the limits of the depth guard with a reserve."""

    robot_radius_m: float
    spare_m: float
    """Distance between the robot and obstacles during the whole move."""
    ahead_m: float
    """Free distance ahead of the robot's front before a move; the depth guard refuses the move otherwise."""
    side_m: float
    """Width added to the radius on both sides of that free distance."""

    def eased(self, by_m: float) -> "NeededSpace":
        """Return the same clearance with every reserve smaller by `by_m`."""
        return NeededSpace(
            self.robot_radius_m, max(self.spare_m - by_m, 0.0), self.ahead_m - by_m, max(self.side_m - by_m, 0.0)
        )


class LatticePlanner:
    """Finds action sequences over the positions and headings that forward moves and turns can reach.

    Headings are numbered: heading k is `base_heading_rad + k * turn_rad`.
    """

    def __init__(
        self, space: FreeSpace, base_heading_rad: float, forward_m: float, turn_rad: float, clearance: NeededSpace
    ) -> None:
        """Prepare one map of allowed forward moves for each heading.

        Raises:
            ValueError: a whole number of turns does not make a full circle.
        """
        self.headings = round(math.tau / turn_rad)
        if not math.isclose(self.headings * turn_rad, math.tau, rel_tol=1e-6):
            raise ValueError(f"turns of {math.degrees(turn_rad):g} degrees do not make a full circle")
        self._space = space
        self._base_heading_rad = base_heading_rad
        self._forward_m = forward_m
        self._turn_rad = turn_rad
        self._spare_m = clearance.spare_m
        blocked = (space.clearance_m < RESOLUTION_M / 2).astype(np.uint8)
        self.allowed_moves: BoolGrid = np.stack(
            [_free_under(blocked, _swath(self.heading_rad(k), forward_m, clearance)) for k in range(self.headings)]
        )
        """(headings, rows, columns): whether a forward move is allowed there."""
        to_spare = np.maximum(space.clearance_m - space.robot_radius_m, 0.0)
        self.extra_cost: npt.NDArray[np.float64] = _NARROW_COST * np.maximum(0.0, 1.0 - to_spare / _NARROW_M)
        """(rows, columns): additional cost of a move that ends there."""

    def heading_rad(self, k: int) -> float:
        """Return the heading with number `k`."""
        return self._base_heading_rad + k * self._turn_rad

    def nearest_heading(self, heading_rad: float) -> int:
        """Return the number of the heading nearest to an angle."""
        return round((heading_rad - self._base_heading_rad) / self._turn_rad) % self.headings

    def heading_error_rad(self, heading_rad: float) -> float:
        """Return the angle between a heading and the nearest of the planner's headings."""
        return abs(math.remainder(heading_rad - self._base_heading_rad, self._turn_rad))

    def forbid(self, pose: Pose) -> None:
        """Forbid forward moves near this pose, whatever the map shows."""
        near = np.hypot(self._space.x_m - pose.x_m, self._space.y_m - pose.y_m) <= _FORBIDDEN_WITHIN_M
        self.allowed_moves[self.nearest_heading(pose.heading_rad)][near] = False

    def follow(self, pose: Pose, actions: tuple[Action, ...]) -> tuple[Pose, ...]:
        """Return the poses of `actions` from `pose`, including it; fewer if a move is not allowed."""
        poses = [pose]
        for action in actions:
            if action is Action.MOVE_FORWARD:
                cell = self._space.cell_of(*pose.position)
                if not self.allowed_moves[(self.nearest_heading(pose.heading_rad), *cell)]:
                    break
                pose = pose.compose(Pose(self._forward_m, 0.0))
            elif action.turns:
                turn = self._turn_rad if action is Action.TURN_LEFT else -self._turn_rad
                pose = pose.compose(Pose(0.0, 0.0, turn))
            poses.append(pose)
        return tuple(poses)

    def plan(self, pose: Pose, targets: BoolGrid) -> tuple[Action, ...] | None:
        """Return the cheapest actions from `pose` to a target pose by A*, or None.

        Args:
            pose: in the site's frame.
            targets: (headings, rows, columns): whether a pose in that cell with that heading is a target.
        """
        space = self._space
        roomy = space.clearance_m >= space.robot_radius_m + self._spare_m
        field = distance_field_m(roomy, np.where(targets.any(axis=0), -0.5, 0.5) * RESOLUTION_M)
        field[~roomy] = np.inf
        remaining = (field / self._forward_m).ravel().tolist()
        extra = self.extra_cost.ravel().tolist()
        rows, columns = space.cells.shape
        area = rows * columns
        may_move, is_target = self.allowed_moves.tobytes(), targets.tobytes()
        headings = self.headings
        steps = [
            (self._forward_m * math.cos(self.heading_rad(k)), self._forward_m * math.sin(self.heading_rad(k)))
            for k in range(headings)
        ]
        x0, y0, scale = space.origin_x_m, space.origin_y_m, 1.0 / RESOLUTION_M

        first_cell = space.cell_of(*pose.position)
        first = (*pose.position, self.nearest_heading(pose.heading_rad), first_cell[0] * columns + first_cell[1])
        states = [first]
        parents: list[tuple[int, Action]] = [(-1, Action.STOP)]
        costs = [0.0]
        best: dict[int, float] = {first[2] * area + first[3]: 0.0}
        queue: list[tuple[float, int]] = [(remaining[first[3]], 0)]
        done: set[int] = set()
        while queue and len(done) < _MAX_EXPANSIONS:
            _, index = heapq.heappop(queue)
            x, y, k, cell = states[index]
            key = k * area + cell
            if key in done:
                continue
            done.add(key)
            if is_target[key]:
                return _actions_to(index, parents)
            options = [
                (x, y, (k + 1) % headings, cell, Action.TURN_LEFT, 1.0),
                (x, y, (k - 1) % headings, cell, Action.TURN_RIGHT, 1.0),
            ]
            if may_move[key]:
                new_x, new_y = x + steps[k][0], y + steps[k][1]
                new_cell = round((new_y - y0) * scale) * columns + round((new_x - x0) * scale)
                options.append((new_x, new_y, k, new_cell, Action.MOVE_FORWARD, 1.0 + extra[new_cell]))
            for new_x, new_y, new_k, new_cell, action, action_cost in options:
                cost = costs[index] + action_cost
                new_key = new_k * area + new_cell
                if new_key in done or cost >= best.get(new_key, math.inf):
                    continue
                estimate = cost + remaining[new_cell]
                if new_cell == cell and estimate == math.inf:
                    estimate = cost  # the start can be outside the field
                if estimate == math.inf:
                    continue
                best[new_key] = cost
                states.append((new_x, new_y, new_k, new_cell))
                parents.append((index, action))
                costs.append(cost)
                heapq.heappush(queue, (estimate, len(states) - 1))
        return None


def _actions_to(index: int, parents: list[tuple[int, Action]]) -> tuple[Action, ...]:
    actions: list[Action] = []
    while parents[index][0] >= 0:
        index, action = parents[index]
        actions.append(action)
    return tuple(reversed(actions))


def _swath(heading_rad: float, forward_m: float, clearance: NeededSpace) -> npt.NDArray[np.uint8]:
    """Return the cells around the robot (at the centre) that must be free for a move along `heading_rad`."""
    slack = RESOLUTION_M * 0.71  # the robot can be anywhere in its cell
    body = clearance.robot_radius_m + clearance.spare_m + slack
    side = clearance.robot_radius_m + clearance.side_m + slack
    front = clearance.robot_radius_m + clearance.ahead_m + slack
    reach = math.ceil((max(math.hypot(front, side), forward_m + body)) / RESOLUTION_M)
    offsets = RESOLUTION_M * np.arange(-reach, reach + 1)
    right, up = np.meshgrid(offsets, offsets)
    ahead = math.cos(heading_rad) * right + math.sin(heading_rad) * up
    left = -math.sin(heading_rad) * right + math.cos(heading_rad) * up
    swept = np.hypot(ahead - np.clip(ahead, 0.0, forward_m), left) <= body
    guarded = (ahead >= 0.0) & (ahead <= front) & (np.abs(left) <= side)
    return np.asarray(swept | guarded, dtype=np.uint8)


def _free_under(blocked: npt.NDArray[np.uint8], kernel: npt.NDArray[np.uint8]) -> BoolGrid:
    """Return for each cell whether no blocked cell is under `kernel` centred there."""
    import cv2

    touched = cv2.dilate(blocked, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=1.0)
    return np.asarray(touched == 0, dtype=np.bool_)
