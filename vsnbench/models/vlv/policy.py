"""The model `vlv`: VLV (NeurIPS 2020), modular: learned value, detector, map, planner and a graph of places.

RGB, depth and odometry in, one of the protocol's actions out; no site, no true pose.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

from vsnbench.errors import ModelError, UsageError
from vsnbench.models.checkpoints.torch_runtime import require_torch
from vsnbench.models.contract import ModelCard, ModelCheck, Policy
from vsnbench.models.vlv.detectors.choosing import open_detector
from vsnbench.models.vlv.detectors.contract import Detection, Detector
from vsnbench.models.vlv.goals import CLASS_OF_GOAL, GOAL_OF_CLASS
from vsnbench.models.vlv.planner import Planner
from vsnbench.models.vlv.search import Search
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.models.vlv.value.estimate import Value, open_value
from vsnbench.settings.yaml_file import read_settings
from vsnbench.values.decision import Box, Decision, Diagnostics
from vsnbench.values.model.trained_camera import TrainedCamera
from vsnbench.values.observation import Observation, Sensor

HABITAT_CAMERA = TrainedCamera(mount_height_m=1.25, tilt_deg=0, horizontal_fov_deg=90, width=224, height=224)
"""Camera that the published navigation ran with, in github.com/MatthewChang/video-dqn: image size and height in
`configs/tasks/pointnav_rgbd.yaml` and `map_and_plan_agent/slam.py`, the rest Habitat's default. The value network was
trained on videos of unknown cameras."""

MODULAR_CARD = ModelCard(
    "modular",
    goals=frozenset(CLASS_OF_GOAL),
    sensors=frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY}),
    forward_m=VLVSettings().forward_m,
    turn_deg=VLVSettings().turn_deg,
)
"""What all models of map, planner and detector state."""


class ModularPolicy(Policy):
    """A policy of map, planner and detector; a subclass chooses where to look for the goal."""

    settings_class: ClassVar = VLVSettings

    def __init__(self, value: Value, model_config: str | Path | VLVSettings | None, device: str) -> None:
        self.settings = _settings_from(model_config)
        self._value = value
        self._detector: Detector = open_detector(self.settings, device)
        self._planner = Planner(self.settings)
        self._search: Search | None = None
        self._class = ""
        goals = frozenset(goal for goal, name in CLASS_OF_GOAL.items() if name in self._detector.classes)
        if not goals:
            classes = ", ".join(CLASS_OF_GOAL.values())
            raise ModelError(
                f"{self.card.name}'s detector, {self._detector.name}, finds none of {classes}",
                advice="use a detector trained on COCO",
            )
        self.card = replace(
            self.card,
            goals=goals,
            sensors=self._read_sensors(),
            weights_sha256=self._value.sha256,
            weights_label="; ".join(filter(None, (self._value.label, self._detector.name))),
            settings=self._record(),
            forward_m=self.settings.forward_m,
            turn_deg=self.settings.turn_deg,
            runs_on={"device": self._value.device if self._value.device != "cpu" else self._detector.device},
        )

    def _read_sensors(self) -> frozenset[Sensor]:
        """Return the sensors that decisions depend on: the colour image only if the detector or the value reads it."""
        images = {Sensor.RGB} if self._value.reads_images else set[Sensor]()
        return self.card.sensors - {Sensor.RGB} | self._detector.sensors | images

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode.

        Raises:
            UsageError: the goal is unknown, or the detector cannot find it.
        """
        if self.card.goals is None or goal not in self.card.goals:
            raise UsageError(
                f"{self.card.name} does not know the goal {goal!r}; it knows {', '.join(sorted(self.card.goals or ()))}"
            )
        self._class = CLASS_OF_GOAL[goal]
        self._detector.begin(seed)
        self._reliability = self._detector.reliability(self._class)
        self._search = self._make_search(seed)

    @abstractmethod
    def _make_search(self, seed: int) -> Search:
        """Return the state of a new episode."""

    def act(self, observation: Observation) -> Decision:
        """Return the next action.

        Raises:
            ModelError: no episode has started, or there is no depth image.
        """
        if self._search is None:
            raise ModelError(f"{self.card.name}: act was called before reset", advice="call reset first")
        if observation.depth_m is None:
            raise ModelError(f"{self.card.name} received no depth image")
        detections = self._detector.detect(observation)
        goals = tuple(
            item for item in detections if item.label == self._class and item.score >= self._reliability.threshold
        )
        value = self._value.of(observation.rgb, self._class) if self._value.reads_images else 0.0
        decision = self._search.step(observation, goals, value)
        shown = self._shown(self._search, decision.diagnostics, detections, value)
        return replace(decision, diagnostics=shown)

    def _shown(
        self, search: Search, explained: Diagnostics, detections: tuple[Detection, ...], value: float
    ) -> Diagnostics:
        """Return the diagnostics of the search with detections, map and candidates."""
        return replace(
            explained,
            boxes=tuple(Box(*item.box, GOAL_OF_CLASS.get(item.label, item.label), item.score) for item in detections),
            map=search.map.grid_map(),
            nodes=tuple(search.graph.nodes),
            scalars={"value": value, "open_candidates": float(len(search.graph.open_candidates))},
            details={**explained.details, "detector": self._detector.name, **search.details()},
        )

    def _record(self) -> Mapping[str, Any]:
        """Return the settings and the detector's identity, without the path of its file."""
        return self.settings.model_dump(mode="json", exclude={"detector_weights"}) | {
            "replan_growth_m": 0.1,  # a former setting that nothing read; without it, campaigns get other keys
            "detector": self._detector.kind,
            "detector_settings": dict(self._detector.settings),
            "detector_sha256": self._detector.weights_sha256,
        }


class VLV(ModularPolicy):
    """The second model of the paper."""

    card = replace(MODULAR_CARD, name="vlv", camera=HABITAT_CAMERA)
    weights_file: ClassVar = "vlv_model.torch"

    def __init__(
        self,
        weights: str | Path | None = None,
        model_config: str | Path | VLVSettings | None = None,
        device: str = "auto",
    ) -> None:
        """Load the weights and prepare the model.

        Args:
            weights: file of the value network; None for `$VSNBENCH_WEIGHTS/vlv_model.torch` if it exists, else none.
            model_config: YAML file of `VLVSettings`, or the settings.
            device: auto, cpu, cuda or mps.

        Raises:
            UsageError: a setting is invalid.
            ModelError: the weights cannot be used.
        """
        settings = _settings_from(model_config)
        super().__init__(open_value(weights, device), settings, device)

    @classmethod
    def check(
        cls,
        weights: str | Path | None = None,
        model_config: str | Path | VLVSettings | None = None,
        device: str = "auto",
    ) -> ModelCheck:
        """Inspect the weights and time both networks. Arguments as for the class.

        Raises:
            UsageError: a setting is invalid.
            ModelError: weights are missing or cannot be used.
        """
        require_torch()
        from vsnbench.models.vlv.checking import check_weights

        settings = _settings_from(model_config)
        checked = check_weights(Path(weights) if weights is not None else None, settings, device)
        card = replace(cls.card, forward_m=settings.forward_m, turn_deg=settings.turn_deg)
        return replace(checked, card=card)

    def _make_search(self, seed: int) -> Search:
        return Search(self.settings, self._planner, seed, self._reliability, with_value=bool(self._value.sha256))


def _settings_from(given: str | Path | VLVSettings | None) -> VLVSettings:
    if isinstance(given, str | Path):
        return read_settings(Path(given), VLVSettings, UsageError, "VLV settings")
    return given or VLVSettings()
