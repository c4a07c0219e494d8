"""A policy with settings, depth and diagnostics: it drives to where it can see farthest, and shows why.

vsnbench run --model examples.widest_opening:WidestOpening --goal chair --starts 1-3 --live
vsnbench run --model examples.widest_opening:WidestOpening --model-config examples/widest_opening.yaml --goal chair
"""

import math
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from vsnbench.errors import ModelError
from vsnbench.models.contract import ModelCard
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Box, Decision, Diagnostics
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.settings_file import read_settings

SECTORS = 9
"""The image is cut into so many upright strips, from left to right."""


class Settings(BaseModel):
    """What a settings file may say; another key is refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    keep_away_m: float = Field(default=0.6, gt=0, le=5, description="nearer things ahead make it turn")
    actions: int = Field(default=60, ge=1, description="after so many it says STOP")


class WidestOpening:
    """It looks for no goal at all: a baseline, and an example."""

    known_goals = None
    needed_sensors = (Sensor.DEPTH, Sensor.ODOMETRY)
    settings_class = Settings

    def __init__(self, model_config: Path | None = None) -> None:
        """Take the settings; `--model-config FILE` of the command line comes as `model_config`."""
        self.settings = Settings()
        if model_config is not None:
            self.settings = read_settings(model_config, Settings, ModelError, "settings of widest-opening")
        self.card = ModelCard(
            "widest-opening",
            sensors=frozenset(self.needed_sensors),
            settings=self.settings.model_dump(),  # part of what the model is: other settings are another model
        )

    def reset(self, goal: str, seed: int) -> None:
        """Begin an episode; every random choice in it follows from the seed."""
        self._random = np.random.default_rng(seed)
        self._side: Action | None = None
        self._actions = 0
        self._visited: list[tuple[float, float]] = []

    def act(self, observation: Observation) -> Decision:
        """Return the next action, with what it was chosen by."""
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
        if self._side is None:  # once begun, a turn goes on to the same side until the way is free
            if widest == middle:
                self._side = (Action.TURN_LEFT, Action.TURN_RIGHT)[int(self._random.integers(2))]
            else:
                self._side = Action.TURN_LEFT if widest < middle else Action.TURN_RIGHT
        return self._side

    def _free_ahead(self, observation: Observation) -> list[float]:
        """Return for each sector how far it is to the nearest thing between ankle and head height, metres."""
        if observation.depth_m is None:
            raise ModelError("widest-opening was handed no depth image")
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
