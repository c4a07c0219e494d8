"""Parameters of the protocol; defaults from the paper (Section 4.1)."""

import math
from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from vsnbench.errors import UsageError
from vsnbench.protocol.execution import (
    CONTINUOUS,
    STACK,
    STACK_FRAMES_HZ,
    STACK_RATE_HZ,
    STOP_AND_GO,
    Execution,
    time_limit_s,
)
from vsnbench.values.movement import Action, Move
from vsnbench.values.placement import PlacementTolerance

PAPER_PROTOCOL = "ros4vsn"
"""Name of the paper's protocol, the default."""
_MOVES: Mapping[Action, tuple[int, int]] = {
    Action.STOP: (0, 0),
    Action.MOVE_FORWARD: (1, 0),
    Action.MOVE_BACKWARD: (-1, 0),
    Action.TURN_LEFT: (0, 1),
    Action.TURN_RIGHT: (0, -1),
}
"""Direction of each discrete action: forwards, and to the left."""
_VERSION_3: Mapping[str, Any] = {"name": PAPER_PROTOCOL, "max_time_s": None, "max_path_m": None, "execution": None}
"""Fields of version 3 with their defaults."""


class DepthGuard(BaseModel):
    """Obstacle check on the depth image before a forward move (paper, Section 3.2.2).

    A move is blocked if at least `min_pixels` valid depth pixels in the robot's swath, between `min_height_m` and
    `max_height_m`, are nearer than `distance_m` to the robot's front. The default leaves 0.15 m after a move of 0.25 m,
    so that an obstacle is still beyond the depth camera's blind zone at the next observation.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = Field(default=True, description="whether forward moves are checked")
    distance_m: float = Field(default=0.40, gt=0, le=2, description="free way needed ahead of the robot's front")
    margin_m: float = Field(default=0.02, ge=0, le=0.5, description="added to the robot's radius on both sides")
    min_height_m: float = Field(default=0.04, ge=0, le=1, description="lower points are floor")
    max_height_m: float = Field(default=1.20, gt=0, le=3, description="higher points pass above the robot")
    min_pixels: int = Field(default=40, ge=1, description="fewer pixels are noise")


class ProtocolParameters(BaseModel):
    """Parameters of the protocol; campaigns with equal parameters are comparable.

    Version 1 measured the distance to a goal through walls; version 2 measures it in sight; version 3 has another name,
    more limits or another execution than the paper's protocol. A campaign keeps its version.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    version: Literal[1, 2, 3] = Field(
        default=2,
        description="1: distance straight through walls; 2: in sight; 3: in sight, with another name or more limits",
    )
    name: str = Field(
        default=PAPER_PROTOCOL, pattern=r"^[a-z0-9][a-z0-9_-]{0,39}$", description="name of the protocol, in tables"
    )

    max_actions: int = Field(default=150, ge=1, le=100_000, description="an episode ends at this action")
    max_time_s: float | None = Field(
        default=None,
        gt=0,
        le=86_400,
        description="an episode ends when it has taken this long on the robot's clock; none for no limit",
    )
    max_path_m: float | None = Field(
        default=None, gt=0, le=10_000, description="an episode ends after a path of this length; none for no limit"
    )
    success_distance_m: float = Field(default=1.0, gt=0, le=10, description="STOP nearer than this succeeds")
    forward_m: float = Field(default=0.25, gt=0, le=2, description="length of MOVE_FORWARD and MOVE_BACKWARD")
    turn_deg: float = Field(default=30.0, gt=0, le=180, description="angle of TURN_LEFT and TURN_RIGHT")
    depth_guard: DepthGuard = Field(default_factory=DepthGuard)
    placement: PlacementTolerance = Field(default_factory=PlacementTolerance, description="tolerance of a placed robot")
    execution: Execution | None = Field(
        default=None,
        description="the robot drives on: while the model thinks, or driven by a stack; none: it rests (stop_and_go)",
    )

    @field_validator("execution", mode="before")
    @classmethod
    def _name_execution(cls, given: Any) -> Any:
        """Accept the words `stop_and_go` and `continuous`, the latter with the default parameters."""
        return {STOP_AND_GO: None, CONTINUOUS: {}}.get(given, given) if isinstance(given, str) else given

    @model_validator(mode="before")
    @classmethod
    def _choose_version(cls, content: Any) -> Any:
        """Set version 3 where the version is not given and a field of version 3 is used."""
        if isinstance(content, Mapping) and "version" not in content and _uses_version_3(content):
            return {**content, "version": 3}
        return content

    @model_validator(mode="after")
    def _check_version(self) -> Self:
        """Refuse a version that does not match the fields, because equal protocols must have equal hashes."""
        if (self.version == 3) != _uses_version_3(dict(self)):
            raise ValueError(
                f"version {self.version} does not match the fields: version 3 has {', '.join(_VERSION_3)}; "
                "leave `version` out"
            )
        return self

    @model_serializer(mode="wrap")
    def _omit_defaults(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit defaults of fields that were added later, so that hashes of campaigns do not change."""
        content: dict[str, Any] = serialize(self)
        if self.placement == PlacementTolerance():
            content.pop("placement", None)
        for name, default in _VERSION_3.items():
            if getattr(self, name) == default:
                content.pop(name, None)
        return content

    def limited_to(self, max_actions: int | None) -> Self:
        """Return these parameters with another maximum number of actions; unchanged for None."""
        return self if max_actions is None else self.model_copy(update={"max_actions": max_actions})

    def executed(self, execution: Execution | None) -> Self:
        """Return these parameters with what is set of another execution; unchanged for None.

        Raises:
            UsageError: no answer could take effect (`invalid-latency`).
        """
        if execution is None:
            return self
        content = {name: value for name, value in self.model_dump().items() if name != "version"}
        own = {} if self.execution is None else dict(self.execution)
        merged = own | {name: getattr(execution, name) for name in execution.model_fields_set}
        if (latency_s := merged.get("latency_s")) is not None and latency_s > merged.get("max_answer_age_s", math.inf):
            raise UsageError(
                f"--continuous {latency_s:g}: protocol {self.name} drops answers older than max_answer_age_s, "
                f"{merged['max_answer_age_s']:g} s",
                advice="give a smaller latency",
                code="invalid-latency",
            )
        return self.model_validate({**content, "execution": merged})

    def driven_by_stack(self, *, guarded: bool = False) -> Self:
        """Return these parameters for a stack, which drives the robot itself: without the depth guard by default.

        The rates of images are those of `execution`, or defaults where it states none.
        """
        stated = Execution(max_rate_hz=STACK_RATE_HZ) if self.execution is None else self.execution
        rates = {"max_rate_hz": stated.max_rate_hz, "frames_hz": stated.frames_hz or STACK_FRAMES_HZ}
        execution = {"driver": STACK, **rates}
        content = {name: value for name, value in self.model_dump().items() if name != "version"}
        guard = {**self.depth_guard.model_dump(), "enabled": guarded}
        return self.model_validate({**content, "execution": execution, "depth_guard": guard})

    @property
    def time_limit_s(self) -> float | None:
        """Time on the robot's clock after which an episode ends (`execution.time_limit_s`); None for no limit."""
        return time_limit_s(self.max_time_s, self.max_actions, drives_on=self.execution is not None)

    @property
    def action_limit(self) -> int | None:
        """Number of actions after which an episode ends; None for continuous execution, whose limit is time."""
        return self.max_actions if self.execution is None else None

    def movement_of(self, action: Action) -> Move:
        """Return the movement of a discrete action: one of the paper's, whose headings are held.

        Raises:
            ValueError: the action has parameters, or robots do not execute it.
        """
        if action not in _MOVES:
            raise ValueError(f"{action} is not a movement")
        ahead, left = _MOVES[action]
        return Move(ahead * self.forward_m, left * math.radians(self.turn_deg), holds_heading=True)

    @property
    def in_sight(self) -> bool:
        """Whether distances are measured along lines that no wall crosses."""
        return self.version >= 2

    @classmethod
    def from_record(cls, content: Mapping[str, Any]) -> Self:
        """Return recorded parameters; those without a version have version 1.

        Raises:
            pydantic.ValidationError: the content is not valid.
        """
        known = {name: value for name, value in content.items() if name != "starting_positions"}
        return cls.model_validate({"version": 1} | known)


def _uses_version_3(content: Mapping[str, Any]) -> bool:
    return any(content.get(name, default) != default for name, default in _VERSION_3.items())
