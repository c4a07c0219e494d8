"""The model `forward`: drives straight on until the way is blocked, then turns. The simplest baseline."""

import math
from dataclasses import replace

import numpy as np

from vsnbench.errors import ModelError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

_NO_MOTION_M = 0.05
"""A forward move with less odometry than this was refused or blocked."""


class ForwardUntilBlocked(Policy):
    """Drives straight on, and turns to a random side at each obstacle until the way is free.

    It never chooses STOP. It shows how far a robot gets without searching.
    """

    card = ModelCard("forward", goal_kinds=frozenset(GoalKind), sensors=frozenset({Sensor.DEPTH, Sensor.ODOMETRY}))

    def __init__(self, look_ahead_m: float = 0.55, half_width_m: float = 0.25) -> None:
        """Set the size of the box ahead of the camera that must be free, in metres."""
        self.card = replace(self.card, settings={"look_ahead_m": look_ahead_m, "half_width_m": half_width_m})
        self._look_ahead_m = look_ahead_m
        self._half_width_m = half_width_m
        self.reset("", 0)

    def reset(self, goal: str, seed: int) -> None:  # noqa: ARG002 - it does not search
        """Start an episode. The side of every turn follows from `seed`."""
        self._random = np.random.default_rng(seed)
        self._before_move: Pose | None = None
        self._turn: Action | None = None
        self._turns_left = 0

    def next_goal(self, goal: str) -> None:
        """Go on: it does not search."""

    def act(self, observation: Observation) -> Decision:
        """Return MOVE_FORWARD if the depth image and the last move allow it, else a turn."""
        did_not_move = self._before_move is not None and observation.pose.distance_to(self._before_move) < _NO_MOTION_M
        self._before_move = None
        if did_not_move:
            self._turns_left = int(self._random.integers(2, 6))
        blocked = self._sees_obstacle(observation)
        if not blocked and self._turns_left == 0:
            self._turn = None
            self._before_move = observation.pose
            return Decision(Action.MOVE_FORWARD, diagnostics=Diagnostics(note="the way is free"))
        if self._turn is None:
            self._turn = (Action.TURN_LEFT, Action.TURN_RIGHT)[int(self._random.integers(2))]
        self._turns_left = max(self._turns_left - 1, 0)
        note = "the last move had no effect" if did_not_move else "an obstacle is ahead" if blocked else "turning away"
        return Decision(self._turn, diagnostics=Diagnostics(note=note))

    def _sees_obstacle(self, observation: Observation) -> bool:
        """Return whether enough of the depth image is in the box ahead, 5 cm to 1 m high."""
        if observation.depth_m is None:
            raise ModelError("forward received no depth image")
        points = observation.camera.points_in_base(observation.depth_m)
        ahead, left, up = points[..., 0], points[..., 1], points[..., 2]
        with np.errstate(invalid="ignore"):
            near = (ahead < self._look_ahead_m) & (np.abs(left) < self._half_width_m) & (up > 0.05) & (up < 1.0)
        return int(np.count_nonzero(near)) >= max(1, math.ceil(0.0005 * near.size))
