"""The file of a stack: how vsnbench tells it the goal, how it says that it has arrived, and how it is told to abort."""

from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.protocol.execution import STACK
from vsnbench.settings.yaml_file import read_settings
from vsnbench.values.action import ActionKind
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.card import ModelCard
from vsnbench.values.observation import Sensor

ANNOTATED_EXAMPLE: Final = Path(__file__).with_name("annotated_stack.yaml")
"""A template for the file of a stack, with every field explained."""
NAME_PATTERN: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$"
GOAL_WORD: Final = "{goal}"
"""Stands for the goal in the arguments of a command and in the operator's text."""


def _http(url: str) -> str:
    parts = urlsplit(url)
    if parts.scheme != "http" or not parts.hostname:
        raise ValueError("must be the address of a server, such as http://127.0.0.1:8080/goal")
    parts.port  # noqa: B018  # raises ValueError for an invalid port
    return url


Url = Annotated[str, Field(max_length=2000), AfterValidator(_http)]
Command = Annotated[list[Annotated[str, Field(max_length=4000)]], Field(min_length=1, max_length=200)]


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
    operator: Annotated[str, Field(max_length=500)] | None = Field(
        default=None, description="what the operator is told to do"
    )


class Arrival(_OneOf):
    """How the stack says that it has arrived, which is its STOP."""

    http: Url | None = Field(default=None, description='polled with GET; its JSON has "arrived": true or false')
    exit_code: Annotated[int, Field(ge=0, le=255)] | None = Field(
        default=None, description="exit code with which the announced command ends; another one is a failure"
    )
    rest_s: Annotated[float, Field(ge=0.5, le=120)] | None = Field(
        default=None, description="time at rest, after the robot has moved"
    )
    operator: Literal[True] | None = Field(default=None, description="key `a` at the terminal, or the page's button")


class Abort(_OneOf):
    """How the stack is told that a trial is over."""

    http: Url | None = Field(default=None, description="POST without a body")
    command: Command | None = Field(default=None, description="program and arguments")


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
    abort: Abort | None = Field(default=None, description="none: a command of `announce` is ended, others are not told")
    timeout_s: float = Field(default=5.0, gt=0, le=60, description="time for an HTTP answer, or for the abort")

    @model_validator(mode="after")
    def _check_ways(self) -> Self:
        if self.arrived.way == "exit_code" and self.announce.way != "command":
            raise ValueError("`arrived: exit_code` is that of the command of `announce`, and there is none")
        if GoalKind.IMAGE in self.goal_kinds:
            raise ValueError("`goal_kinds`: a stack takes no photographs: category, text or instruction")
        return self

    @property
    def text(self) -> str:
        """How it is announced, arrives and aborts, in words."""
        abort = self.abort.way if self.abort is not None else "none"
        return f"announced by {self.announce.way}, arrived by {self.arrived.way}, abort by {abort}"


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
    return ModelCard(
        name=stack.name,
        weights_label=f"version {stack.version}",
        goals=None if stack.goals is None else frozenset(stack.goals),
        goal_kinds=stack.goal_kinds,
        sensors=frozenset({Sensor.ODOMETRY}),
        action_kinds=frozenset({ActionKind.DISCRETE}),
        settings={STACK: ways},
        code={"version": stack.version} | ({"commit": stack.commit} if stack.commit else {}),
        files={STACK: file_sha256(path)},
        deterministic=False,
    )
