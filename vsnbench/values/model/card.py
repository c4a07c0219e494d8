"""Requirements and identity of a model: one value for its class, its server, the record and the tables."""

from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import field, fields, replace
from enum import StrEnum
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic.dataclasses import dataclass

from vsnbench.text.sanitize import sanitize
from vsnbench.values.camera import CameraRole
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.trained_camera import TrainedCamera
from vsnbench.values.movement import TILTS, Action, ActionKind
from vsnbench.values.observation import MAX_HISTORY, Budget, Observation, Sensor, shown_to_policy


def _named(name: str) -> str:
    if not name.strip():
        raise ValueError("must not be empty")
    return sanitize(name)


def _json(settings: Mapping[str, Any]) -> Mapping[str, Any]:
    if problem := next(_not_json(settings, "settings"), ""):
        raise ValueError(problem)
    return settings


def _not_json(value: object, where: str) -> Iterator[str]:
    """Yield the parts of a value that cannot be stored as JSON."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from _not_json(item, f"{where}[{name!r}]")
    elif isinstance(value, list | tuple | set | frozenset):
        for item in value:
            yield from _not_json(item, f"an item of {where}")
    elif not (value is None or isinstance(value, str | bool | int | float) or type(value).__module__ == "numpy"):
        yield f"{where} must be JSON (strings, numbers, lists, mappings), not {type(value).__name__}"


def _tilts(mapped: Mapping[Action, Action]) -> Mapping[Action, Action]:
    if not all(tilt in TILTS and (other is Action.NOOP or other.moves) for tilt, other in mapped.items()):
        raise ValueError("must map LOOK_UP and LOOK_DOWN to other actions: {Action.LOOK_UP: Action.NOOP}")
    return mapped


class Anchor(StrEnum):
    """Pose of the robot that an answer's coordinates refer to, in continuous execution."""

    CAPTURE = "capture"
    """The robot's pose when the image was captured: the runner moves the answer by the odometry since then."""
    ARRIVAL = "arrival"
    """Its pose when the answer arrives: the model compensates the motion itself."""


@dataclass(frozen=True, slots=True, config=ConfigDict(strict=True))
class ModelCard:
    """Requirements and identity of a model.

    Raises:
        pydantic.ValidationError: a field has a value of another type, or beyond its limits.
    """

    name: Annotated[str, AfterValidator(_named)]
    goals: Annotated[frozenset[str] | None, Field(description="write frozenset({'chair'})")] = None
    """Goal categories that the model knows; None for any category."""
    sensors: Annotated[frozenset[Sensor], Field(description="write frozenset({Sensor.RGB})")] = frozenset()
    """Sensors that the model needs. The robot must have all of them; the model receives no others."""
    action_kinds: Annotated[
        frozenset[ActionKind], Field(min_length=1, description="write frozenset({ActionKind.WAYPOINT})")
    ] = frozenset({ActionKind.DISCRETE})
    """Kinds of answers that the model gives. The robot must be able to execute all of them."""
    weights_sha256: str = ""
    weights_label: Annotated[str, AfterValidator(sanitize)] = ""
    """Short description of the weights, shown in every table."""
    settings: Annotated[Mapping[str, Any], AfterValidator(_json)] = field(default_factory=dict)
    """Everything else that results depend on, such as the precision. JSON-serializable; part of the identity."""
    runs_on: Mapping[str, str | bool | int | float | None] = field(default_factory=dict, compare=False)
    """Device, runtime and number of threads. Recorded as provenance; not part of the identity."""
    code: Mapping[str, str] = field(default_factory=dict)
    """For a model in another process: the description of its source that its server sends. Part of the identity."""
    files: Mapping[str, str] = field(default_factory=dict)
    """For a model in another process: SHA-256 of the files that it received, by option."""
    forward_m: Annotated[float, Field(gt=0, le=360)] | None = field(default=None, compare=False)
    """Length of MOVE_FORWARD that the model assumes; None if it uses the task's. Not part of the identity."""
    turn_deg: Annotated[float, Field(gt=0, le=360)] | None = field(default=None, compare=False)
    """Angle of TURN_LEFT that the model assumes; None if it uses the task's. Not part of the identity."""
    action_map: Annotated[Mapping[Action, Action], AfterValidator(_tilts)] = field(default_factory=dict)
    """What the robot does for LOOK_UP and LOOK_DOWN: `{Action.LOOK_UP: Action.NOOP, Action.LOOK_DOWN: Action.NOOP}`. An
    episode in which the model answers with one that is not here ends as model_error. Part of the identity."""
    stand_in: bool = False
    """Whether the weights only stand in for the model's own. Such a model must not drive a real robot."""
    camera: TrainedCamera | None = field(default=None, compare=False)
    """Camera that the model was trained with; None if it is not stated. Not part of the identity."""
    goal_kinds: Annotated[frozenset[GoalKind], Field(min_length=1, description="write frozenset({GoalKind.TEXT})")] = (
        frozenset({GoalKind.CATEGORY})
    )
    """Kinds of goals that the model takes. A model of text goals also takes categories, as words."""
    anchor: Anchor = Anchor.CAPTURE
    """Pose that coordinates of answers refer to where the robot drives on while the model thinks. Part of the identity
    where it is `arrival`."""
    history: Annotated[int, Field(ge=0, le=MAX_HISTORY)] = 0
    """Most observations that the model takes in `Observation.history`: those since the last call of `act`, of which the
    newest are kept. 0 for none. Part of the identity where it is not 0."""
    cameras: Annotated[frozenset[CameraRole], Field(description="write frozenset({CameraRole.LEFT})")] = frozenset()
    """Further cameras that the model needs, by role. The robot must have all of them; `front` is the main camera, which
    every robot has. Part of the identity where it is not empty."""
    deterministic: bool = field(default=True, compare=False)
    """Whether the same seed and observations give the same actions. Not part of the identity."""
    surveyed: bool = False
    """Whether the model receives the site, which makes it an upper bound. Set from `Policy.needs_survey` when the model
    is loaded."""

    @property
    def identity(self) -> list[Any]:
        """What the hash of a recorded model is made of: name, weights, settings, files and code."""
        content = [self.name, self.weights_sha256, dict(self.settings), self.surveyed]
        return [*content, dict(self.files), self._source] if self.files or self.code else content

    @property
    def _source(self) -> dict[str, str]:
        """The code without its commit: commits that do not change the source do not change the model."""
        return {name: value for name, value in self.code.items() if name != "commit"}

    def recorded(self, files: Mapping[str, str], code: Mapping[str, str]) -> Self:
        """Return the card as the record has it: kinds of answers and replaced tilts are among the settings.

        Args:
            files: SHA-256 of the files that the model received, by option.
            code: identity of its source.
        """
        settings = dict(self.settings)
        if self.action_kinds != frozenset({ActionKind.DISCRETE}):
            settings["action_kinds"] = sorted(self.action_kinds)
        if self.action_map:
            settings["action_map"] = {tilt.value: action.value for tilt, action in sorted(self.action_map.items())}
        if self.anchor is not Anchor.CAPTURE:
            settings["anchor"] = self.anchor.value
        if self.history:
            settings["history"] = self.history
        if self.cameras:
            settings["cameras"] = sorted(self.cameras)
        return replace(self, settings=settings, files=files, code=code)

    def shown(self, observation: Observation, budget: Budget | None = None) -> Observation:
        """Return an observation as the model receives it: private copies of the sensors and cameras on the card.

        Raises:
            SensorLostError: a sensor or a camera has no measurement.
        """
        return shown_to_policy(observation, self.sensors, budget, self.cameras)

    def difference(self, other: Self) -> str:
        """Return how another card differs in what identifies the model, or an empty string."""
        pairs = {
            item.name: (getattr(self, item.name), getattr(other, item.name)) for item in fields(self) if item.compare
        }
        pairs["code"] = (self._source, other._source)
        return ", ".join(
            f"{name} {str(old)[:40]!r} → {str(new)[:40]!r}" for name, (old, new) in pairs.items() if old != new
        )

    def as_json(self) -> dict[str, Any]:
        """Return all fields as JSON values; sets become sorted lists."""
        return {item.name: _plain(getattr(self, item.name)) for item in fields(self)}


def copy_of(card: ModelCard, *, surveyed: bool = False) -> ModelCard:
    """Return a validated copy of a card, which later changes of the original do not reach.

    Raises:
        pydantic.ValidationError: a field was changed after the card was created, to an invalid value.
    """
    values = {item.name: getattr(card, item.name) for item in fields(ModelCard)}
    return ModelCard(**{**values, "surveyed": surveyed})


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, AbstractSet):
        return sorted(map(str, value))
    return dict(value) if isinstance(value, Mapping) else value
