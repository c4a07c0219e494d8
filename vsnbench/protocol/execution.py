"""Executions in which the robot drives on: while the model thinks, or because a stack drives it.

In continuous execution, the model is called with the newest observation whenever it is free. Its answer takes effect
when it arrives, and replaces the running path without a stop. A stack commands the base itself: vsnbench watches
it and does not ask it for decisions. In stop-and-go execution, the default, the robot rests while the model thinks.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, Final, Literal, Self, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from vsnbench.errors import UsageError
from vsnbench.values.movement import Movement

STOP_AND_GO: Final = "stop_and_go"
CONTINUOUS: Final = "continuous"
STACK: Final = "stack"
"""The three words for how trials are executed, in records and reports."""
MEASURED: Final = "measured"
KINDS_WHILE_DRIVING: Final = frozenset(made.kind for made in get_args(Movement) if made.replaces_path)
"""Kinds of answers that can replace a running path. Discrete actions, moves and chunks go from rest to rest."""
STACK_RATE_HZ: Final = 2.0
STACK_FRAMES_HZ: Final = 5.0
"""Rates of the images of a trial with a stack, where the protocol states none: with depth, and of the film."""
SECONDS_PER_ACTION: Final = 2.0
"""Time that a continuous trial has for each action of `max_actions`, where the protocol has no time limit. A move of
0.25 m at 0.3 m/s takes 1.4 s, a turn of 30 degrees at 0.5 rad/s 1.7 s."""
_OPTION = "--continuous"


class StopSource(StrEnum):
    """What was taken as the STOP of a stack; recorded as the model's own name of the action."""

    DECLARED = "declared"
    """The stack said that it had arrived."""
    AT_REST = "at rest"
    """The robot had been at rest for long enough."""
    OPERATOR = "operator"
    """The operator declared the arrival."""


class Execution(BaseModel):
    """Parameters of an execution in which the robot drives on."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    latency_s: float | None = Field(
        default=None,
        ge=0,
        le=60,
        description="declared time from the capture of an image to the effect of the answer; none: as measured",
    )
    max_rate_hz: float = Field(default=10.0, gt=0, le=50, description="the model is called at most this often")
    max_answer_age_s: float = Field(default=5.0, gt=0, le=60, description="an older answer is dropped as stale")
    frames_hz: float | None = Field(
        default=None, gt=0, le=30, description="rate of images that are kept between the answers; none: no others"
    )

    driver: Literal["model", "stack"] = Field(
        default="model",
        description="who commands the base: vsnbench, as a model answers, or a stack that drives itself",
    )

    @model_serializer(mode="wrap")
    def _omit_defaults(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit defaults of fields that were added later, so that hashes of campaigns do not change."""
        content: dict[str, Any] = serialize(self)
        if self.frames_hz is None:
            content.pop("frames_hz", None)
        if self.driver == "model":
            content.pop("driver", None)
        return content

    @property
    def is_by_stack(self) -> bool:
        """Whether a stack drives the robot, and vsnbench only watches."""
        return self.driver == STACK

    @property
    def text(self) -> str:
        """The execution in words, such as `continuous, latency 0.3 s`."""
        return text_of_execution({"execution": self.model_dump()})

    @model_validator(mode="after")
    def _check_latency(self) -> Self:
        if self.latency_s is not None and self.latency_s > self.max_answer_age_s:
            raise ValueError(
                f"a latency of {self.latency_s:g} s makes every answer older than max_answer_age_s "
                f"({self.max_answer_age_s:g} s): the robot would never drive"
            )
        return self


def parse_continuous(text: str) -> Execution:
    """Return the execution of a value of `--continuous`: a latency in seconds, or `measured`.

    Raises:
        UsageError: it is neither, or no answer could take effect (`invalid-latency`).
    """
    if text.strip() == MEASURED:
        return Execution(latency_s=None)
    most_s = Execution().max_answer_age_s
    try:
        latency_s = float(text)
    except ValueError:
        latency_s = -1.0
    if not 0 <= latency_s <= most_s:
        raise UsageError(
            f"{_OPTION} {text}: a latency must be 0 to {most_s:g} s, the age at which an answer is dropped",
            advice=f"give seconds, like {_OPTION} 0.3, or {MEASURED}",
            code="invalid-latency",
        )
    return Execution(latency_s=latency_s)


def text_of_execution(protocol: Mapping[str, Any]) -> str:
    """Return how trials under recorded parameters were executed, such as `continuous, latency 0.3 s`."""
    if (word := execution_of(protocol)) != CONTINUOUS:
        return word
    latency_s = protocol["execution"].get("latency_s")
    return f"{CONTINUOUS}, {'measured latency' if latency_s is None else f'latency {latency_s:g} s'}"


def time_limit_s(max_time_s: float | None, max_actions: int | None, *, drives_on: bool) -> float | None:
    """Return the time on the robot's clock after which an episode ends; None for no limit.

    The number of answers of an episode in which the robot drives on depends on the latency, and is not limited: it ends
    at the latest after `SECONDS_PER_ACTION` for each action of `max_actions`.
    """
    return SECONDS_PER_ACTION * max_actions if max_time_s is None and max_actions and drives_on else max_time_s


def execution_of(protocol: Mapping[str, Any]) -> str:
    """Return how trials under recorded parameters were executed, in one word."""
    execution = protocol.get("execution") if isinstance(protocol, Mapping) else None
    if not isinstance(execution, Mapping):
        return STOP_AND_GO
    return STACK if execution.get("driver") == STACK else CONTINUOUS
