"""The base class of models (`Policy`) and the description of a model (`ModelCard`)."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from pydantic import BaseModel

from vsnbench.models.task import Task
from vsnbench.models.trained_camera import TrainedCamera
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Site
from vsnbench.text.sanitize import sanitize
from vsnbench.values.action import Action
from vsnbench.values.decision import Decision
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import ActionKind
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base


@dataclass(frozen=True, slots=True)
class ModelCard:
    """Requirements and identity of a model."""

    name: str
    goals: frozenset[str] | None = None
    """Goal categories that the model knows; None for any category."""
    sensors: frozenset[Sensor] = frozenset()
    """Sensors that the model needs. The robot must have all of them; the model receives no others."""
    action_kinds: frozenset[ActionKind] = frozenset({ActionKind.DISCRETE})
    """Kinds of answers that the model gives. The robot must be able to execute all of them."""
    weights_sha256: str = ""
    weights_label: str = ""
    """Short description of the weights, shown in every table."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Everything else that results depend on, such as the precision. JSON-serializable; part of the identity."""
    runs_on: Mapping[str, str | int | None] = field(default_factory=dict, compare=False)
    """Device, runtime and number of threads. Recorded as provenance; not part of the identity."""
    code: Mapping[str, str] = field(default_factory=dict)
    """For a model in another process: the description of its source that its server sends. Part of the identity."""
    files: Mapping[str, str] = field(default_factory=dict)
    """For a model in another process: SHA-256 of the files that it received, by option."""
    forward_m: float | None = field(default=None, compare=False)
    """Length of MOVE_FORWARD that the model assumes; None if it uses the task's. Not part of the identity."""
    turn_deg: float | None = field(default=None, compare=False)
    """Angle of TURN_LEFT that the model assumes; None if it uses the task's. Not part of the identity."""
    action_map: Mapping[Action, Action] = field(default_factory=dict)
    """What the robot does for LOOK_UP and LOOK_DOWN: `{Action.LOOK_UP: Action.NOOP, Action.LOOK_DOWN: Action.NOOP}`. An
    episode in which the model answers with one that is not here ends as model_error. Part of the identity."""
    stand_in: bool = False
    """Whether the weights only stand in for the model's own. Such a model must not drive a real robot."""
    camera: TrainedCamera | None = field(default=None, compare=False)
    """Camera that the model was trained with; None if it is not stated. Not part of the identity."""
    goal_kinds: frozenset[GoalKind] = frozenset({GoalKind.CATEGORY})
    """Kinds of goals that the model takes. A model of text goals also takes categories, as words. Not part of the
    identity."""

    def __post_init__(self) -> None:
        """Make the texts that tables show printable. The registry refuses a card whose texts are not strings."""
        for name in ("name", "weights_label"):
            text = getattr(self, name)
            if isinstance(text, str):
                object.__setattr__(self, name, sanitize(text))


@dataclass(frozen=True, slots=True)
class Timing:
    """Duration of one step in one engine."""

    engine: str
    median_ms: float
    steps: int


@dataclass(frozen=True, slots=True)
class ModelCheck:
    """Result of a check of weights."""

    model: str
    weights: Path
    sha256: str
    size_bytes: int
    facts: Mapping[str, str | int | float | bool | None]
    """Contents of the weights, in display order."""
    chosen_engine: str
    parity: Mapping[str, float | int | bool] | None
    """Comparison of the chosen engine with the reference; None if the reference was chosen."""
    timings: tuple[Timing, ...]
    warning: str = ""
    """Reason why the fastest engine was not chosen."""
    card: ModelCard | None = None
    """Kinds of goals and answers, and step sizes, with the settings of this check; None for the default card's."""


class Policy(ABC):
    """A visual-semantic-navigation model.

    A subclass sets `card`, as a class attribute or in its constructor, and implements `reset` and `act`. It overrides
    `begin` if it uses the protocol's or the robot's numbers, such as the length of a move.
    """

    card: ModelCard
    """Name, sensors, goals and settings of the model. Fixed when the model is loaded."""

    needs_survey: bool = False
    """Whether `survey` is called before each `reset`. Such a model is recorded as an upper bound."""

    known_goals: ClassVar[Sequence[str] | None] = None
    """Goal categories, for `vsnbench models show`. None for any category. `card.goals` decides in a run."""

    needed_sensors: ClassVar[Sequence[Sensor]] = ()
    """Sensors, for `vsnbench models show`. `card.sensors` decides in a run."""

    default_card: ClassVar[ModelCard | None] = None
    """Kinds of goals and answers, and step sizes, for `vsnbench models show`, if `card` is set in the constructor.
    `card` decides in a run."""

    weights_file: ClassVar[str] = ""
    """Name of the weights in the directory of weights; empty if the model has none."""

    settings_class: ClassVar[type[BaseModel] | None] = None
    """Schema of the settings file, for `vsnbench models show`."""

    @abstractmethod
    def reset(self, goal: str, seed: int) -> None:
        """Start an episode and forget the previous one.

        Args:
            goal: the goal as a `vsnbench.Goal`, which is also a string: the category, such as `chair`, the words of a
                text or an instruction, or the id of an image goal.
            seed: source of every random choice in the episode.
        """

    def begin(self, task: Task) -> None:
        """Start an episode. Calls `reset` with the goal and the seed by default.

        Args:
            task: goal, seed, and the numbers of the protocol and the robot.
        """
        self.reset(task.goal, task.seed)

    @abstractmethod
    def act(self, observation: Observation) -> Decision:
        """Return the next action.

        Args:
            observation: read-only arrays of the sensors on the card, and the remaining budget. Reading another sensor
                raises an error.
        """

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Receive the whole site. Called only if `needs_survey` is True.

        Args:
            site: the site of the episode.
            start: true pose of the robot at the start, in the site's frame.
            base: dimensions and limits of the robot's base.
            parameters: rules of the trials.
        """
        raise NotImplementedError(f"{type(self).__name__}.survey")

    @classmethod
    def check(cls, weights: Path | None, model_config: Path | None, device: str) -> ModelCheck:
        """Inspect and time weights without running trials, for `vsnbench models check`. Optional.

        Args:
            weights: file of the weights; None for the default.
            model_config: settings file; None for the default settings.
            device: `auto`, `cpu`, `cuda` or `mps`.
        """
        raise NotImplementedError(f"{cls.__name__}.check")

    def close(self) -> None:
        """Release resources. Does nothing by default."""


class BatchPolicy(Policy):
    """A policy that keeps each episode in a state of its own, so that one object serves many robots.

    A subclass implements `new_state` and `act_batch` instead of `reset` and `act`. `vsnbench models serve --sessions`
    shares the object among all sessions; a run in this process has one episode at a time.
    """

    _state: Any = None

    @abstractmethod
    def new_state(self, goal: str, seed: int) -> Any:
        """Return the state of a new episode, with everything that the model remembers; arguments as for `reset`."""

    @abstractmethod
    def act_batch(self, observations: Sequence[Observation], states: Sequence[Any]) -> Sequence[Decision]:
        """Return the next action of each episode.

        Args:
            observations: one of each episode, with images of the same size; as for `act`.
            states: the states of the episodes, in the same order. They are changed in place.
        """

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode and forget the previous one."""
        self._state = self.new_state(goal, seed)

    def act(self, observation: Observation) -> Decision:
        """Return the next action."""
        return self.act_batch([observation], [self._state])[0]
