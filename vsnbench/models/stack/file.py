"""The file of a stack: how vsnbench tells it the goal, how it says that it has arrived, and how it is told to abort."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.protocol.execution import STACK
from vsnbench.settings.yaml_file import read_settings
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.card import ModelCard
from vsnbench.values.movement import ActionKind
from vsnbench.values.observation import Sensor

ANNOTATED_EXAMPLE: Final = Path(__file__).with_name("annotated_stack.yaml")
"""A template for the file of a stack, with every field explained."""
NAME_PATTERN: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$"
GOAL_WORD: Final = "{goal}"
"""Stands for the goal in the arguments of a command, in the content of a message and in the operator's text."""
_TOPIC: Final = r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$"
_TYPE: Final = r"^[a-z][a-z0-9_]*/(msg/)?[A-Z][A-Za-z0-9]*$"
_ACTION_TYPE: Final = r"^[a-z][a-z0-9_]*/action/[A-Z][A-Za-z0-9]*$"
_FIELD: Final = r"^[A-Za-z0-9_]+(\.[A-Za-z0-9_]+)*$"


def _http(url: str) -> str:
    parts = urlsplit(url)
    if parts.scheme != "http" or not parts.hostname:
        raise ValueError("must be the address of a server, such as http://127.0.0.1:8080/goal")
    parts.port  # noqa: B018  # raises ValueError for an invalid port
    return url


Url = Annotated[str, Field(max_length=2000), AfterValidator(_http)]
Command = Annotated[list[Annotated[str, Field(max_length=4000)]], Field(min_length=1, max_length=200)]


Scalar = bool | int | float | Annotated[str, Field(max_length=200)]


class _Message(BaseModel):
    """A message to a topic, or a goal of an action, of other nodes on the robot's network."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: Annotated[str, Field(pattern=_TOPIC, max_length=200)] = Field(
        description="relative to the robot's namespace unless it begins with a slash"
    )
    type: Annotated[str, Field(pattern=_TYPE, max_length=200)]
    content: dict[str, Any] = Field(default={}, description="fields that differ from their defaults")
    by_goal: dict[str, dict[str, Any]] = Field(
        default={}, description="fields by the category of the goal, such as its pose on the stack's map"
    )

    def content_for(self, goal: str, category: str) -> dict[str, Any]:
        """Return the content for a goal.

        Raises:
            ModelError: `by_goal` does not have the goal's category.
        """
        if self.by_goal and category not in self.by_goal:
            raise ModelError(
                f"the stack's file has no content of {self.name} for {category}: it has {', '.join(self.by_goal)}",
                advice="add it to `by_goal`",
                code="unknown-stack-goal",
            )
        merged = _merged(self.content, self.by_goal.get(category, {}))
        return {name: _with_goal(value, goal) for name, value in merged.items()}


class ToTopic(_Message):
    """A message that is published once."""


class ToAction(_Message):
    """A goal of a ROS 2 action."""

    type: Annotated[str, Field(pattern=_ACTION_TYPE, max_length=200)]


class FromTopic(BaseModel):
    """A value in the messages of a topic."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: Annotated[str, Field(pattern=_TOPIC, max_length=200)]
    type: Annotated[str, Field(pattern=_TYPE, max_length=200)]
    field: Annotated[str, Field(pattern=_FIELD, max_length=200)] = "data"
    equals: Scalar = True
    failed: Scalar | None = Field(default=None, description="value with which the stack says that it failed")

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        if self.failed is not None and self.failed == self.equals:
            raise ValueError(f"`equals` and `failed` are both {self.equals!r}")
        return self


def _merged(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return two nested mappings as one; the second has priority."""
    both = {
        name: _merged(one[name], value)
        for name, value in other.items()
        if isinstance(value, Mapping) and isinstance(one.get(name), Mapping)
    }
    return {**one, **other, **both}


def _with_goal(content: Any, goal: str) -> Any:
    """Return content with the goal in place of its word."""
    if isinstance(content, Mapping):
        return {name: _with_goal(value, goal) for name, value in content.items()}
    if isinstance(content, list):
        return [_with_goal(value, goal) for value in content]
    return content.replace(GOAL_WORD, goal) if isinstance(content, str) else content


class _OneOf(BaseModel):
    """A choice: exactly one field is set."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        if len(self.model_fields_set) != 1 or getattr(self, self.way) is None:
            raise ValueError(f"must have exactly one of {', '.join(type(self).model_fields)}")
        return self

    @property
    def way(self) -> str:
        """Name of the field that is set."""
        return next(iter(self.model_fields_set))


class Announcement(_OneOf):
    """How the stack learns the goal of a trial."""

    http: Url | None = Field(default=None, description="POST of the goal as JSON; any 2xx answer accepts it")
    command: Command | None = Field(default=None, description="program and arguments, started without a shell")
    topic: ToTopic | None = Field(default=None, description="a message that is published once")
    action: ToAction | None = Field(default=None, description="a goal of a ROS 2 action")
    operator: Annotated[str, Field(max_length=500)] | None = Field(
        default=None, description="what the operator is told to do"
    )


class Arrival(_OneOf):
    """How the stack says that it has arrived, which is its STOP."""

    http: Url | None = Field(default=None, description='polled with GET; its JSON has "arrived": true or false')
    exit_code: Annotated[int, Field(ge=0, le=255)] | None = Field(
        default=None, description="exit code with which the announced command ends; another one is a failure"
    )
    topic: FromTopic | None = Field(default=None, description="a value in the messages of a topic")
    action: Literal[True] | None = Field(default=None, description="the action of `announce` has succeeded")
    rest_s: Annotated[float, Field(ge=0.5, le=120)] | None = Field(
        default=None, description="time at rest, after the robot has moved"
    )
    operator: Literal[True] | None = Field(default=None, description="key `a` at the terminal, or the page's button")


class Abort(_OneOf):
    """How the stack is told that a trial is over."""

    http: Url | None = Field(default=None, description="POST without a body")
    command: Command | None = Field(default=None, description="program and arguments")
    topic: ToTopic | None = Field(default=None, description="a message that is published once")


class Stack(BaseModel):
    """A stack that drives itself, as its file describes it."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: str = Field(pattern=NAME_PATTERN, description="name in tables")
    version: str = Field(min_length=1, max_length=60, description="version in tables")
    commit: str = Field(default="", max_length=60, description="commit of the stack's source, if it is known")
    goals: list[str] | None = Field(default=None, description="categories that it knows; none for any")
    goal_kinds: frozenset[GoalKind] = Field(
        default=frozenset({GoalKind.CATEGORY}), min_length=1, description="kinds of goals that it takes"
    )
    announce: Announcement
    arrived: Arrival
    abort: Abort | None = Field(default=None, description="none: a command or an action of `announce` is ended")
    timeout_s: float = Field(default=5.0, gt=0, le=60, description="time for an HTTP answer, or for the abort")
    depth_guard: bool = Field(default=False, description="stop the robot before an obstacle ahead, and end the trial")

    @model_validator(mode="after")
    def _check_ways(self) -> Self:
        if self.arrived.way == "exit_code" and self.announce.way != "command":
            raise ValueError("`arrived: exit_code` is that of the command of `announce`, and there is none")
        if self.arrived.way == "action" and self.announce.way != "action":
            raise ValueError("`arrived: action` is the end of the action of `announce`, and there is none")
        if self.goal_kinds - {GoalKind.CATEGORY, GoalKind.TEXT, GoalKind.INSTRUCTION}:
            raise ValueError("`goal_kinds`: a stack is told words only: category, text or instruction")
        return self

    @property
    def messages(self) -> list[_Message]:
        """What it is told by topics and actions."""
        told = [self.announce.topic, self.announce.action, self.abort.topic if self.abort else None]
        return [message for message in told if message is not None]

    @property
    def text(self) -> str:
        """How it is announced, arrives and aborts, in words."""
        abort = self.abort.way if self.abort is not None else "none"
        guard = ", with the depth guard" if self.depth_guard else ""
        return f"announced by {self.announce.way}, arrived by {self.arrived.way}, abort by {abort}{guard}"


def load_stack(path: Path) -> Stack:
    """Read the file of a stack.

    Raises:
        ModelError: it cannot be read or is invalid; the message names the line and the field.
    """
    return read_settings(path, Stack, ModelError, "stack")


def card_of(stack: Stack, path: Path) -> ModelCard:
    """Return a stack as a model: its identity is its name, version, file and stated commit."""
    ways: dict[str, Any] = stack.model_dump(
        mode="json", include={"announce", "arrived", "abort", "timeout_s"}, exclude_none=True
    )
    goals = stack.goals
    if goals is None:  # those that it has a message for, or any
        goals = next((list(message.by_goal) for message in stack.messages if message.by_goal), None)
    return ModelCard(
        name=stack.name,
        weights_label=f"version {stack.version}",
        goals=None if goals is None else frozenset(goals),
        goal_kinds=stack.goal_kinds,
        sensors=frozenset({Sensor.ODOMETRY}),
        action_kinds=frozenset({ActionKind.DISCRETE}),
        settings={STACK: ways},
        code={"version": stack.version} | ({"commit": stack.commit} if stack.commit else {}),
        files={STACK: file_sha256(path)},
        deterministic=False,
    )
