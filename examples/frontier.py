"""A frontier explorer: it maps free space from depth, drives to the nearest unknown area, and to the goal once seen.

It sees the goal by the simulator's labels, so it runs in simulation only. FrontierDiscrete plans in the same way and
answers with discrete actions. Success rates: examples/README.md.

vsnbench run --model examples.frontier:Frontier,examples.frontier:FrontierDiscrete --goal chair
"""

from typing import Any

import numpy as np

from examples.depth_map import CELL_M, CELLS, REACH_M, DepthMap, cells
from vsnbench import Action, ActionKind, Decision, ModelCard, Observation, Policy, Sensor, Task, Waypoint

SENSORS = frozenset({Sensor.DEPTH, Sensor.ODOMETRY, Sensor.INSTANCES})
STOP_M = 0.8
"""Distance to the goal at which to stop."""


class Frontier(Policy):
    """Answers with waypoints."""

    card = ModelCard("frontier", sensors=SENSORS, action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.WAYPOINT}))
    radius_m, forward_m, turn_rad = 0.2, 0.25, np.radians(30)

    def begin(self, task: Task) -> None:
        """Start an episode with the numbers of the robot and the protocol."""
        self.radius_m, self.forward_m = task.robot.radius_m, task.protocol.forward_m
        self.turn_rad = np.radians(task.protocol.turn_deg)
        super().begin(task)

    def reset(self, goal: str, seed: int) -> None:
        """Forget the last episode."""
        self.goal = goal
        self.map = DepthMap(self.radius_m)
        self.stop = np.zeros(CELLS**2, bool)
        self.tried = np.zeros(CELLS**2)  # number of actions near a cell that were to reach it

    def act(self, observation: Observation) -> Decision:
        """Drive to a place to stop if one is reachable, else to a frontier."""
        lens, rays = self.map.look(observation)
        range_m = abs(rays)
        goal = self.goal_pixels(observation)[::2, ::2] & (range_m > STOP_M / 2) & (range_m < REACH_M)
        before_m = np.arange(0.3, STOP_M, CELL_M / 2)[:, None]  # on the lines of sight: no wall is between
        self.stop[cells(lens + rays[goal] * np.maximum(1 - before_m / range_m[goal], 0.0))] = True
        if self.stop[abs(self.map.way) < 0.08].any():
            return Decision(Action.STOP)
        untried = self.tried < 20
        path = self.map.path(self.stop & untried) or self.map.path(self.map.frontier() & untried)
        if not path:
            return Decision(Action.STOP)  # nothing is left to explore
        end = self.map.way[path[-1]]
        if abs(end) < 1.5:
            self.tried[abs(self.map.way - end) < 0.3] += 1
        if self.stop[path[-1]]:
            return self.drive(path)
        if abs(end) < 0.6:
            return self.turn(float(np.angle(end)))
        return self.drive(path[:-8])  # what lies at a frontier is not known

    def goal_pixels(self, observation: Observation) -> Any:
        """Return which pixels show the goal."""
        labels = observation.instances
        return np.isin(labels.ids, [number for number, category in labels.categories.items() if category == self.goal])

    def drive(self, path: list[int]) -> Decision:
        """Drive along the straight beginning of a path."""
        way = self.map.straight(path)
        return Decision(Waypoint(way.real, way.imag))

    def turn(self, angle_rad: float) -> Decision:
        """Turn on the spot."""
        return Decision(Waypoint(0.0, 0.0, heading_rad=angle_rad))


class FrontierDiscrete(Frontier):
    """Answers with discrete actions."""

    card = ModelCard("frontier-discrete", sensors=SENSORS)

    def drive(self, path: list[int]) -> Decision:
        """Turn to the heading from which a forward move brings the robot nearest to the end of the path."""
        turns = np.array(sorted(range(-5, 7), key=abs))
        moves = self.forward_m * self.map.ahead * np.exp(1j * turns * self.turn_rad)
        swaths = cells(self.map.here + moves * np.linspace(0.1, 1, 20)[:, None])
        room_m = self.map.clearance_m[swaths].min(axis=0)
        is_free = room_m >= min(self.radius_m + 0.03, self.map.clearance_m[path[0]])
        cost_m = self.map.cost_m[swaths[-1]] + 0.03 * abs(turns)
        best = turns[np.where(is_free | ~is_free.any(), cost_m, np.inf).argmin()]
        return self.turn(best) if best else Decision(Action.MOVE_FORWARD)

    def turn(self, angle_rad: float) -> Decision:
        """Turn one step to the side of an angle."""
        return Decision(Action.TURN_LEFT if angle_rad > 0 else Action.TURN_RIGHT)
