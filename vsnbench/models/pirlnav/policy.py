"""The model `pirlnav`: PIRLNav (CVPR 2023), end to end, from the authors' checkpoints.

Camera image and odometry in, one of the protocol's actions out.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError, UsageError
from vsnbench.models.checkpoints.weights import embedded_weights, find_weights
from vsnbench.models.contract import BatchPolicy, ModelCard, ModelCheck
from vsnbench.models.pirlnav.checkpoint import Checkpoint, read_checkpoint
from vsnbench.models.pirlnav.engine import StepInput, StepOutput
from vsnbench.models.pirlnav.localisation import Localiser
from vsnbench.models.pirlnav.preprocessing import augment, preprocess
from vsnbench.models.pirlnav.settings import PIRLNavSettings
from vsnbench.settings.yaml_file import read_settings
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.model.trained_camera import TrainedCamera
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor

logger = logging.getLogger(__name__)

GOALS: Final = MappingProxyType({"chair": 0, "bed": 1, "plant": 2, "toilet": 3, "monitor": 4, "sofa": 5})
"""The paper's goal -> HM3D's number; its monitor is HM3D's tv_monitor."""


ACTIONS: Final = MappingProxyType(
    {
        "STOP": Action.STOP,
        "MOVE_FORWARD": Action.MOVE_FORWARD,
        "TURN_LEFT": Action.TURN_LEFT,
        "TURN_RIGHT": Action.TURN_RIGHT,
        "LOOK_UP": Action.MOVE_BACKWARD,
        "LOOK_DOWN": Action.MOVE_FORWARD,
    }
)
"""The network's action -> what the robot does, in the order of the logits; the camera of these robots cannot tilt
(paper, Section 3.2.2)."""
HABITAT_CAMERA = TrainedCamera(mount_height_m=0.88, tilt_deg=0, horizontal_fov_deg=79, width=640, height=480)
"""Of the published checkpoints: `configs/tasks/objectnav_hm3d.yaml` of github.com/Ram81/pirlnav."""
DEMONSTRATION_CAMERA = TrainedCamera(
    mount_height_m=(0.5, 0.75), tilt_deg=(-5, 5), horizontal_fov_deg=(55, 68), width=640, height=480
)
"""Of the embedded demonstration weights: `training/recipe.py`."""


@dataclass(slots=True)
class _Episode:
    """What the model remembers of an episode."""

    goal: int
    random: np.random.Generator
    localiser: Localiser
    previous_action: int = 0
    begins: bool = True
    memory: Any = None
    """Recurrent state of the network; None before the first step."""


class PIRLNav(BatchPolicy):
    """The first model of the paper."""

    card = ModelCard(
        "pirlnav",
        goals=frozenset(GOALS),
        sensors=frozenset({Sensor.RGB, Sensor.ODOMETRY}),
        forward_m=0.25,
        turn_deg=30.0,
        camera=HABITAT_CAMERA,
    )
    weights_file: ClassVar = "pirlnav.ckpt"
    settings_class: ClassVar = PIRLNavSettings

    def __init__(
        self,
        weights: str | Path | None = None,
        model_config: str | Path | PIRLNavSettings | None = None,
        device: str = "auto",
        runtime: str | None = None,
    ) -> None:
        """Load a checkpoint and prepare the network.

        Args:
            weights: checkpoint, or `embedded`; None for `$VSNBENCH_WEIGHTS/pirlnav.ckpt`, or else the embedded weights.
            model_config: YAML file of `PIRLNavSettings`, or the settings.
            device: auto, cpu, cuda or mps.
            runtime: replaces that of the settings, so that workers on other machines use the same runtime.

        Raises:
            UsageError: a setting is invalid.
            ModelError: the weights, the device or its runtime are missing, or the weights cannot be used.
        """
        from vsnbench.models.pirlnav.acceleration import choose_engine

        settings = _settings_from(model_config)
        if runtime is not None:
            settings = PIRLNavSettings.model_validate({**settings.model_dump(), "runtime": runtime})
        checkpoint = _checkpoint_at(weights)
        self.chosen = choose_engine(checkpoint, settings, device)
        logger.info("PIRLNav runs on %s", self.chosen.engine.label)
        self._sampled = settings.decision == "sampled" or (
            settings.decision == "auto" and (checkpoint.fine_tuned or checkpoint.demonstration)
        )
        self._as_published = settings.as_published
        self._image_size_px = checkpoint.architecture.image_size_px
        self._localiser = Localiser(settings)
        self._settings = settings
        self.card = replace(
            self.card,
            weights_sha256=checkpoint.sha256,
            weights_label=describe_weights(checkpoint),
            settings=self._record_of(settings, checkpoint),
            camera=trained_camera(checkpoint),
            runs_on={
                "device": self.chosen.device,
                "runtime": self.chosen.runtime,
                "threads": self.chosen.threads,
            },
            stand_in=weights is None and checkpoint.path == embedded_weights(self.weights_file),
        )

    @classmethod
    def check(
        cls,
        weights: str | Path | None = None,
        model_config: str | Path | PIRLNavSettings | None = None,
        device: str = "auto",
    ) -> ModelCheck:
        """Inspect a checkpoint, and compare and time its engine. Arguments as for the class.

        Raises:
            UsageError: a setting is invalid.
            ModelError: the weights cannot be used.
        """
        from vsnbench.models.pirlnav.checking import check_checkpoint

        checkpoint = _checkpoint_at(weights)
        checked = check_checkpoint(checkpoint, _settings_from(model_config), device)
        return replace(checked, card=replace(cls.card, camera=trained_camera(checkpoint)))

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode. With `as_published`, the odometry continues from the previous one.

        Raises:
            UsageError: the network does not know that goal.
        """
        self._state = self._episode(goal, seed, self._localiser)
        self._localiser.reset()

    def new_state(self, goal: str, seed: int) -> _Episode:
        """Return the state of a new episode.

        Raises:
            UsageError: the network does not know that goal, or episodes depend on each other.
        """
        if self._as_published:
            raise UsageError(
                "pirlnav: with as_published, an episode depends on the robot's previous one",
                advice="serve it with --sessions 1",
            )
        return self._episode(goal, seed, Localiser(self._settings))

    def _episode(self, goal: str, seed: int, localiser: Localiser) -> _Episode:
        if goal not in GOALS:
            raise UsageError(f"pirlnav does not know the goal {goal!r}; it knows {', '.join(GOALS)}")
        return _Episode(GOALS[goal], np.random.default_rng(seed), localiser)

    def act_batch(self, observations: Sequence[Observation], states: Sequence[_Episode | None]) -> list[Decision]:
        """Return the next action of each episode.

        The chosen action is the network's previous action in the next step, even if the robot could not execute it.

        Raises:
            ModelError: no episode has started, or the network's output is not finite.
        """
        episodes = [state for state in states if state is not None]
        if len(episodes) != len(states):
            raise ModelError("pirlnav: act was called before reset", advice="call reset first")
        pairs = list(zip(observations, episodes, strict=True))
        steps = [self._input(observation, episode) for observation, episode in pairs]
        answers = self.chosen.engine.step_together(steps, [episode.memory for episode in episodes])
        decisions = []
        for step, episode, (output, memory) in zip(steps, episodes, answers, strict=True):
            episode.memory = memory
            decisions.append(self._decision(step, episode, output))
        return decisions

    def _input(self, observation: Observation, episode: _Episode) -> StepInput:
        image = preprocess(observation.rgb, self._image_size_px)
        if self._as_published:
            image = augment(image, episode.random)
        gps_m, compass_rad = episode.localiser.read(observation.pose)
        return StepInput(image, gps_m, compass_rad, episode.goal, episode.previous_action, episode.begins)

    def _decision(self, step: StepInput, episode: _Episode, output: StepOutput) -> Decision:
        probabilities = softmax(output.logits)
        index = self._choose(probabilities, episode.random)
        episode.previous_action, episode.begins = index, False
        name, action = list(ACTIONS.items())[index]
        episode.localiser.moved(action)
        scalars = {
            "gps_forward_m": step.gps_m[0],
            "gps_left_m" if self._as_published else "gps_right_m": step.gps_m[1],
            "compass_rad": step.compass_rad,
        }
        if math.isfinite(output.value):
            scalars["value"] = output.value
        return Decision(
            action=action,
            raw_action=name,
            diagnostics=Diagnostics(
                probabilities={name: float(p) for name, p in zip(ACTIONS, probabilities, strict=True)},
                scalars=scalars,
                details={"logits": [float(logit) for logit in output.logits]},
            ),
        )

    def _choose(self, probabilities: npt.NDArray[np.float64], random: np.random.Generator) -> int:
        if not self._sampled:
            return int(probabilities.argmax())
        sampled = int(np.searchsorted(np.cumsum(probabilities), random.random(), side="right"))
        return min(sampled, len(ACTIONS) - 1)

    def _record_of(self, settings: PIRLNavSettings, checkpoint: Checkpoint) -> dict[str, Any]:
        """Return the settings that results depend on, with every `auto` resolved."""
        return settings.model_dump(mode="json", exclude={"runtime", "threads"}) | {
            "decision": "sampled" if self._sampled else "greedy",
            "precision": self.chosen.precision,
            "architecture": checkpoint.architecture.summary,
            "training_steps": checkpoint.training_step,
        }


def _settings_from(given: str | Path | PIRLNavSettings | None) -> PIRLNavSettings:
    if isinstance(given, str | Path):
        return read_settings(Path(given), PIRLNavSettings, UsageError, "PIRLNav settings")
    return given or PIRLNavSettings()


def _checkpoint_at(weights: str | Path | None) -> Checkpoint:
    path = find_weights("pirlnav", PIRLNav.weights_file, Path(weights) if weights else None)
    checkpoint = read_checkpoint(path)
    sizes = checkpoint.architecture
    if sizes.actions != len(ACTIONS) or sizes.goals != len(GOALS):
        raise ModelError(
            f"{path}: trained for {sizes.actions} actions and {sizes.goals} goals; only PIRLNav's {len(ACTIONS)} "
            f"actions and HM3D's {len(GOALS)} goals are supported"
        )
    return checkpoint


def trained_camera(checkpoint: Checkpoint) -> TrainedCamera:
    """Return the camera that a checkpoint was trained with."""
    return DEMONSTRATION_CAMERA if checkpoint.demonstration else HABITAT_CAMERA


def describe_weights(checkpoint: Checkpoint) -> str:
    """Return a description of the weights."""
    if checkpoint.demonstration:
        return "embedded demonstration weights, trained in simulated apartments, not the published model"
    training = "RL fine-tuned" if checkpoint.fine_tuned else "imitation only"
    steps = f", {checkpoint.training_step / 1e6:g} M steps" if checkpoint.training_step is not None else ""
    return f"{checkpoint.path.name}, {training}{steps}"


def softmax(logits: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    """Return the probabilities of the actions.

    Raises:
        ModelError: a logit is not finite.
    """
    exact = logits.astype(np.float64)
    if not np.isfinite(exact).all():
        raise ModelError(f"pirlnav: the network's output is not finite: {logits.tolist()}")
    powers = np.exp(exact - exact.max())
    shares: npt.NDArray[np.float64] = powers / powers.sum()
    return shares
