"""The base class of models: `Policy`."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pydantic import BaseModel

from vsnbench.models.task import Task
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Site
from vsnbench.values.decision import Decision
from vsnbench.values.model.card import ModelCard
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

__all__ = ["BatchPolicy", "ModelCard", "ModelCheck", "Policy", "Timing"]


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
    """Name, sensors, goals and settings of the model. Fixed when the model is loaded. A class whose constructor sets it
    can have a card, too, for what `vsnbench models show` prints without creating the model."""

    needs_survey: bool = False
    """Whether `survey` is called before each `reset`. Such a model is recorded as an upper bound."""

    announcement: str = ""
    """What the operator is told when an episode has begun; empty for nothing. A stack that a person starts has one."""

    asks_operator: bool = False
    """Whether the operator says that it has arrived, which is its STOP."""

    weights_file: ClassVar[str] = ""
    """Name of the weights in the directory of weights; empty if the model has none."""

    settings_class: ClassVar[type[BaseModel] | None] = None
    """Schema of the settings file, for `vsnbench models show`."""

    @abstractmethod
    def reset(self, goal: str, seed: int) -> None:
        """Start an episode and forget the previous one.

        Args:
            goal: the goal as a `vsnbench.Goal`, which is also a string: the category, such as `chair`, the words of a
                text or an instruction, or the id of an image goal, a point or a route.
            seed: source of every random choice in the episode.
        """

    def begin(self, task: Task) -> None:
        """Start an episode. Calls `reset` with the goal and the seed by default.

        Args:
            task: goal, seed, and the numbers of the protocol and the robot.
        """
        self.reset(task.goal, task.seed)

    def next_goal(self, goal: str) -> None:
        """Receive the next goal of a sequence where the last one ended, and keep everything that was learned.

        Called only if the card's `goal_kinds` have `GoalKind.SEQUENCE`; for other models, `begin` is called for each
        goal. The robot has not moved in between, and `Observation.pose` continues.

        Args:
            goal: as for `reset`; never the sequence itself.
        """
        raise NotImplementedError(f"{type(self).__name__}.next_goal: goal_kinds of its card have `sequence`")

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

    def end_episode(self) -> None:
        """Learn that the episode has ended. Must not wait.

        Does nothing by default. A stack is told to abort here, before the robot is at rest.
        """

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
