"""The model `forward`: straight on until the way is blocked, then turn; the cheapest baseline."""

import math

import numpy as np

from vsnbench.errors import ModelError
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision, Diagnostics
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.pose import Pose

_STOOD_STILL_M = 0.05
"""A forward move that odometry saw go less than this was refused or blocked."""


class ForwardUntilBlocked:
    """Walks straight, and turns to a side drawn for each obstacle until the way is free again.

    It never says STOP: what it shows is how far a robot gets that looks for nothing.
    """

    def __init__(self, look_ahead_m: float = 0.55, half_width_m: float = 0.25) -> None:
        """Take the size of the box ahead of the camera that must be free, metres."""
        settings = {"look_ahead_m": look_ahead_m, "half_width_m": half_width_m}
        sensors = frozenset({Sensor.DEPTH, Sensor.ODOMETRY})
        self.card = ModelCard(name="forward", sensors=sensors, settings=settings)
        self._look_ahead_m = look_ahead_m
        self._half_width_m = half_width_m
        self.reset("", 0)

    def reset(self, goal: str, seed: int) -> None:  # noqa: ARG002 - it looks for nothing
        """Start an episode; the side of every turn follows from `seed`."""
        self._random = np.random.default_rng(seed)
        self._before_move: Pose | None = None
        self._turn: Action | None = None
        self._turns_left = 0

    def act(self, observation: Observation) -> Decision:
        """Return MOVE_FORWARD where the depth image and the last move say so, else a turn."""
        stood_still = self._before_move is not None and observation.pose.distance_to(self._before_move) < _STOOD_STILL_M
        self._before_move = None
        if stood_still:
            self._turns_left = int(self._random.integers(2, 6))
        blocked = self._sees_obstacle(observation)
        if not blocked and self._turns_left == 0:
            self._turn = None
            self._before_move = observation.pose
            return Decision(Action.MOVE_FORWARD, diagnostics=Diagnostics(note="the way is free"))
        if self._turn is None:
            self._turn = (Action.TURN_LEFT, Action.TURN_RIGHT)[int(self._random.integers(2))]
        self._turns_left = max(self._turns_left - 1, 0)
        note = "the last move did not move" if stood_still else "something stands ahead" if blocked else "turning away"
        return Decision(self._turn, diagnostics=Diagnostics(note=note))

    def _sees_obstacle(self, observation: Observation) -> bool:
        """Whether enough of the depth image lies in the box ahead, between ankle height and a metre."""
        if observation.depth_m is None:
            raise ModelError("forward was handed no depth image")
        points = observation.camera.points_in_base(observation.depth_m)
        ahead, left, up = points[..., 0], points[..., 1], points[..., 2]
        with np.errstate(invalid="ignore"):
            near = (ahead < self._look_ahead_m) & (np.abs(left) < self._half_width_m) & (up > 0.05) & (up < 1.0)
        return int(np.count_nonzero(near)) >= max(1, math.ceil(0.0005 * near.size))
