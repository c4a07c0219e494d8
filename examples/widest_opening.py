"""A policy with settings, depth and diagnostics: it drives towards the most distant free view.

vsnbench run --model examples.widest_opening:WidestOpening --goal chair --starts 1-3 --live
vsnbench run --model examples.widest_opening:WidestOpening --model-config examples/widest_opening.yaml --goal chair
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from vsnbench import (
    Action,
    Box,
    Decision,
    Diagnostics,
    ModelCard,
    ModelError,
    Observation,
    Policy,
    Pose,
    Sensor,
    read_settings,
)

SECTORS = 9
"""Number of vertical strips into which the image is divided, from left to right."""


class Settings(BaseModel):
    """Keys of a settings file. An unknown key is refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keep_away_m: float = Field(default=0.6, gt=0, le=5, description="turn if something ahead is nearer")
    actions: int = Field(default=60, ge=1, description="number of actions before STOP")


class WidestOpening(Policy):
    """A baseline and an example. It does not search for the goal."""

    card = ModelCard("widest-opening", sensors=frozenset({Sensor.DEPTH, Sensor.ODOMETRY}))
    settings_class = Settings

    def __init__(self, model_config: Path | None = None) -> None:
        """Read the settings. `--model-config FILE` on the command line is passed as `model_config`."""
        self.settings = Settings()
        if model_config is not None:
            self.settings = read_settings(model_config, Settings, ModelError, "settings of widest-opening")
        # The settings are part of the identity: other settings are another model.
        self.card = replace(self.card, settings=self.settings.model_dump())

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode. Every random choice in it follows from the seed."""
        self._random = np.random.default_rng(seed)
        self._side: Action | None = None
        self._actions = 0
        self._visited: list[tuple[float, float]] = []

    def act(self, observation: Observation) -> Decision:
        """Return the next action and its reasons."""
        self._actions += 1
        self._visited.append(observation.pose.position)
        free_m = self._free_ahead(observation)
        widest = int(np.argmax(free_m))
        action = self._choose(free_m, widest)
        return Decision(action, diagnostics=self._explain(observation, free_m, widest, action))

    def _choose(self, free_m: list[float], widest: int) -> Action:
        if self._actions >= self.settings.actions:
            return Action.STOP
        middle = SECTORS // 2
        if min(free_m[middle - 1 : middle + 2]) > self.settings.keep_away_m:
            self._side = None
            return Action.MOVE_FORWARD
        if self._side is None:  # a turn continues to the same side until the way is free
            if widest == middle:
                self._side = (Action.TURN_LEFT, Action.TURN_RIGHT)[int(self._random.integers(2))]
            else:
                self._side = Action.TURN_LEFT if widest < middle else Action.TURN_RIGHT
        return self._side

    def _free_ahead(self, observation: Observation) -> list[float]:
        """Return the distance to the nearest obstacle in each sector, in metres, between ankle and head height."""
        if observation.depth_m is None:
            raise ModelError("widest-opening received no depth image")
        points = observation.camera.points_in_base(observation.depth_m)  # (H, W, 3): x forward, y left, z up
        with np.errstate(invalid="ignore"):
            counts = (points[..., 2] > 0.05) & (points[..., 2] < 1.2)
        far_m = np.where(counts, np.hypot(points[..., 0], points[..., 1]), observation.camera.depth_max_m)
        return [float(np.nanpercentile(strip, 2)) for strip in np.array_split(far_m, SECTORS, axis=1)]

    def _explain(self, observation: Observation, free_m: list[float], widest: int, action: Action) -> Diagnostics:
        camera = observation.camera
        left, right = (camera.width * edge / SECTORS for edge in (widest, widest + 1))
        bearing_rad = math.atan2(camera.center_px[0] - (left + right) / 2, camera.focal_px)
        ahead = Pose(free_m[widest] * math.cos(bearing_rad), free_m[widest] * math.sin(bearing_rad))
        target = observation.pose.compose(ahead).position
        return Diagnostics(
            boxes=(Box(left, 0.0, right, float(camera.height), "widest", 1.0),),
            sub_goal=target,
            path=(observation.pose.position, target),
            nodes=tuple(self._visited),
            scalars={"free_ahead_m": free_m[SECTORS // 2], "widest_m": free_m[widest]},
            note=f"{action.value.lower().replace('_', ' ')}: {free_m[SECTORS // 2]:.2f} m free ahead",
            details={"free_m": free_m},
        )
