"""A reactive policy that answers with velocities: it steers towards free space, and to the goal once it is in sight.

It sees the goal by the simulator's labels, so it runs in simulation only. It has no map. It remembers the
obstacles of its last images, so that it does not turn into what it has just passed. Success rates: examples/README.md.

vsnbench run --model examples.velocity:Reactive --goal chair
"""

from collections import deque
from typing import Any

import numpy as np

from vsnbench import Action, ActionKind, Decision, ModelCard, Observation, Policy, Sensor, Task, Velocity

STRIPS = 15
"""Vertical strips of the image, from left to right."""
STOP_M = 0.75
"""Distance of the goal at which the policy stops."""
MARGIN_M = 0.08
"""Room that the robot keeps on both sides."""
ARC_TIMES_S = np.arange(0.1, 1.25, 0.1)
"""Times at which an arc is checked: the duration of a velocity, and a little more."""


class Reactive(Policy):
    """Turns towards free space while it drives, and on the spot where there is none."""

    card = ModelCard(
        "reactive",
        sensors=frozenset({Sensor.DEPTH, Sensor.ODOMETRY, Sensor.INSTANCES}),
        action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.VELOCITY}),
    )
    radius_m, max_linear_m_s, max_angular_rad_s = 0.2, 0.3, 0.8

    def begin(self, task: Task) -> None:
        """Start an episode within the limits of the robot."""
        self.radius_m = task.robot.radius_m
        self.max_linear_m_s = min(0.3, task.robot.max_linear_m_s)
        self.max_angular_rad_s = min(0.8, task.robot.max_angular_rad_s)
        super().begin(task)

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode. The seed decides to which side the robot turns first in front of an obstacle."""
        self.goal = goal
        self.random = np.random.default_rng(seed)
        self.side, self.turns, self.sent_from = 0.0, 0, complex(np.inf)
        self.obstacles: deque[Any] = deque(maxlen=40)  # what the last images showed, in the frame of the odometry
        self.angular_rad_s = np.linspace(-self.max_angular_rad_s, self.max_angular_rad_s, 21)

    def act(self, observation: Observation) -> Decision:
        """Return a velocity for at most one second, or STOP at the goal."""
        camera, labels, depth_m = observation.camera, observation.instances, observation.depth_m
        if labels is None or depth_m is None:
            raise ValueError("the card asks for depth and labels")
        x_m, y_m, z_m = np.moveaxis(camera.points_in_base(depth_m), 2, 0)
        range_m = np.hypot(x_m, y_m)
        ids = [number for number, category in labels.categories.items() if category == self.goal]
        goal = np.isin(labels.ids, ids) & (range_m < np.inf)
        if np.count_nonzero(goal) > 50 and range_m[goal].min() < STOP_M:
            return Decision(Action.STOP)
        obstacle = (z_m > 0.05) & (z_m < 1.2) & ~goal
        here, ahead = complex(observation.pose.x_m, observation.pose.y_m), np.exp(1j * observation.pose.heading_rad)
        if abs(here - self.sent_from) < 0.02:  # the depth guard refused to drive
            self.turns = 4
        points = here + ahead * (x_m + 1j * y_m)[obstacle & (range_m < 3.0)]
        self.obstacles.append(np.unique(np.round(points * 20) / 20))  # in a grid of 5 cm
        around = (np.unique(np.concatenate(self.obstacles)) - here) / ahead
        around = around[abs(around) < 1.0]
        bearing_rad = self.bearing(observation, goal, np.where(obstacle, range_m, camera.depth_max_m))
        wanted_rad_s = np.clip(1.2 * bearing_rad, -self.max_angular_rad_s, self.max_angular_rad_s)
        for linear_m_s in (self.max_linear_m_s, self.max_linear_m_s / 3):  # slow where the fast arcs are not free
            arcs = np.cumsum(0.1 * linear_m_s * np.exp(1j * np.outer(ARC_TIMES_S, self.angular_rad_s)), axis=0)
            arcs = np.vstack((arcs, arcs[-1] + 0.4 * np.exp(1j * ARC_TIMES_S[-1] * self.angular_rad_s)))
            room_m = np.min(abs(arcs[..., None] - around), axis=(0, 2), initial=9.0)
            is_free = room_m > self.radius_m + MARGIN_M
            if is_free.any() and self.turns <= 0:
                self.side, self.sent_from = 0.0, here
                best = np.where(is_free, abs(self.angular_rad_s - wanted_rad_s), np.inf).argmin()
                return Decision(Velocity(linear_m_s, float(self.angular_rad_s[best]), 1.0))
        self.turns, self.sent_from = self.turns - 1, complex(np.inf)
        # Turn on the spot, and always to the same side until the way is free.
        self.side = self.side or float(np.sign(bearing_rad) or self.random.choice((-1.0, 1.0)))
        return Decision(Velocity(0.0, self.side * self.max_angular_rad_s, 0.6))

    def bearing(self, observation: Observation, goal: Any, far_m: Any) -> float:
        """Return the direction of the goal, or of the widest opening if the goal is not in sight."""
        camera = observation.camera
        bearings_rad = np.arctan(camera.rays(camera.width, camera.height).left)
        if goal.any():
            return float(np.median(bearings_rad[np.nonzero(goal)[1]]))
        strips_m = [float(np.nanpercentile(strip, 2)) for strip in np.array_split(far_m, STRIPS, axis=1)]
        smooth_m = np.convolve(np.minimum(strips_m, 4.0), np.ones(5) / 5, "valid")
        return float(bearings_rad[round((int(smooth_m.argmax()) + 2.5) / STRIPS * (camera.width - 1))])
