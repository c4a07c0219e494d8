"""A frontier explorer: it maps free space from depth, drives to the nearest unknown area, and to the goal once seen.

It sees the goal by the simulator's labels, so it runs in simulation only. The built-in model `frontier` explores by
discrete actions, with a detector that real robots can use. Success rates: examples/README.md.

vsnbench run --model examples.frontier:Frontier --goal chair
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
    radius_m = 0.2

    def begin(self, task: Task) -> None:
        """Start an episode with the radius of the robot."""
        self.radius_m = task.robot.radius_m
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
        self.mark(observation, lens, rays)
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

    def mark(self, observation: Observation, lens: complex, rays: Any) -> None:
        """Mark where to stop at what the image shows of the goal."""
        self.stop[self.stops(self.goal_pixels(observation), lens, rays)] = True

    def stops(self, pixels: Any, lens: complex, rays: Any) -> Any:
        """Return the cells where to stop at what some pixels show."""
        range_m = abs(rays)
        goal = pixels[::2, ::2] & (range_m > STOP_M / 2) & (range_m < REACH_M)
        before_m = np.arange(0.3, STOP_M, CELL_M / 2)[:, None]  # on the lines of sight: no wall is between
        return cells(lens + rays[goal] * np.maximum(1 - before_m / range_m[goal], 0.0))

    def goal_pixels(self, observation: Observation) -> Any:
        """Return which pixels show the goal."""
        labels = observation.instances
        if labels is None:
            raise ValueError("the card asks for labels")
        return np.isin(labels.ids, [number for number, category in labels.categories.items() if category == self.goal])

    def drive(self, path: list[int]) -> Decision:
        """Drive along the straight beginning of a path."""
        way = self.map.straight(path)
        return Decision(Waypoint(way.real, way.imag))

    def turn(self, angle_rad: float) -> Decision:
        """Turn on the spot."""
        return Decision(Waypoint(0.0, 0.0, heading_rad=angle_rad))
