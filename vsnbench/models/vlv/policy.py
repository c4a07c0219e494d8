"""The model `vlv`: VLV (NeurIPS 2020), modular: learned value, detector, map, planner and a graph of places.

RGB, depth and odometry in, one of the protocol's actions out; no site, no true pose.
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from vsnbench.errors import ModelError, UsageError
from vsnbench.models.contract import ModelCard
from vsnbench.models.description import ModelCheck
from vsnbench.models.torch_runtime import require_torch
from vsnbench.models.vlv.detectors.choosing import open_detector
from vsnbench.models.vlv.detectors.contract import Detection, Detector
from vsnbench.models.vlv.goals import CLASS_OF_GOAL, GOAL_OF_CLASS
from vsnbench.models.vlv.planner import Planner
from vsnbench.models.vlv.search import Move, Search
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.models.vlv.value import open_value
from vsnbench.protocol.decision import Box, Decision, Diagnostics
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.settings_file import read_settings

logger = logging.getLogger(__name__)


class VLV:
    """The paper's second model."""

    known_goals: ClassVar = tuple(CLASS_OF_GOAL)
    needed_sensors: ClassVar = (Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY)
    weights_file: ClassVar = "vlv_model.torch"
    settings_class: ClassVar = VLVSettings

    card: ModelCard

    def __init__(
        self,
        weights: str | Path | None = None,
        model_config: str | Path | VLVSettings | None = None,
        device: str = "auto",
    ) -> None:
        """Load what there is of weights and make the model ready.

        Args:
            weights: the value network's file; None looks for `$VSNBENCH_WEIGHTS/vlv_model.torch`, and goes without.
            model_config: a YAML file of `VLVSettings`, or the settings themselves.
            device: auto, cpu, cuda or mps.

        Raises:
            UsageError: a setting is unknown or does not fit.
            ModelError: weights that were named cannot be used.
        """
        self.settings = _settings_from(model_config)
        self._value = open_value(weights, device)
        self._detector: Detector = open_detector(self.settings, device)
        self._planner = Planner(self.settings)
        self._search: Search | None = None
        self._class = ""
        goals = frozenset(goal for goal, name in CLASS_OF_GOAL.items() if name in self._detector.classes)
        if not goals:
            raise ModelError(
                f"vlv's detector, {self._detector.name}, finds none of {', '.join(CLASS_OF_GOAL.values())}",
                advice="take one that was trained on COCO",
            )
        self.card = ModelCard(
            name="vlv",
            goals=goals,
            sensors=frozenset(self.needed_sensors) | self._detector.sensors,
            weights_sha256=self._value.sha256,
            weights_label=f"{self._value.label}; {self._detector.name}",
            settings=self._record(),
            runs_on={"device": device},
        )

    @classmethod
    def check(
        cls,
        weights: str | Path | None = None,
        model_config: str | Path | VLVSettings | None = None,
        device: str = "auto",
    ) -> ModelCheck:
        """Say what is in the weights and how fast both networks are; arguments as for the class.

        Raises:
            UsageError: a setting is unknown or does not fit.
            ModelError: weights are missing or cannot be used.
        """
        require_torch()
        from vsnbench.models.vlv.checking import check_weights

        return check_weights(Path(weights) if weights is not None else None, _settings_from(model_config), device)

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode.

        Raises:
            UsageError: it does not know that goal, or its detector cannot find it.
        """
        if self.card.goals is None or goal not in self.card.goals:
            raise UsageError(
                f"vlv does not know the goal {goal!r}; it knows {', '.join(sorted(self.card.goals or ()))}"
            )
        self._class = CLASS_OF_GOAL[goal]
        self._detector.begin(seed)
        self._search = Search(self.settings, self._planner, seed, with_value=bool(self._value.sha256))

    def act(self, observation: Observation) -> Decision:
        """Return the next action.

        Raises:
            ModelError: no episode was begun, or it was handed no depth image.
        """
        if self._search is None:
            raise ModelError("vlv was asked to act before an episode began", advice="call reset first")
        if observation.depth_m is None:
            raise ModelError("vlv was handed no depth image")
        detections = self._detector.detect(observation)
        wanted = tuple(
            each for each in detections if each.label == self._class and each.score >= self.settings.detector_threshold
        )
        value = self._value.of(observation.rgb, self._class)
        move = self._search.step(observation, wanted, value)
        return Decision(move.action, diagnostics=self._diagnostics(self._search, move, detections, value))

    def _diagnostics(self, search: Search, move: Move, detections: tuple[Detection, ...], value: float) -> Diagnostics:
        return Diagnostics(
            boxes=tuple(Box(*each.box, GOAL_OF_CLASS.get(each.label, each.label), each.score) for each in detections),
            map=search.map.grid_map(),
            sub_goal=move.sub_goal,
            path=move.path,
            nodes=tuple(node.point for node in search.graph.nodes),
            scalars={"value": value, "open_candidates": float(len(search.graph.open_candidates))},
            note=f"{move.mode}: {move.note}",
            details={"mode": move.mode.value, "detector": self._detector.name, **search.details()},
        )

    def _record(self) -> Mapping[str, Any]:
        """Return the settings as used, and what the detector is; where its file lies is no part of that."""
        return self.settings.model_dump(mode="json", exclude={"detector_weights"}) | {
            "detector": self._detector.kind.value,
            "detector_settings": dict(self._detector.settings),
            "detector_sha256": self._detector.weights_sha256,
        }


def _settings_from(given: str | Path | VLVSettings | None) -> VLVSettings:
    if given is None:
        return VLVSettings()
    if isinstance(given, VLVSettings):
        return given
    return read_settings(Path(given), VLVSettings, UsageError, "VLV settings")
