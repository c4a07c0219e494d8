"""The numbers of the protocol as data; the defaults are the paper's (Section 4.1)."""

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

from vsnbench.protocol.placement import PlacementTolerance


class DepthGuard(BaseModel):
    """The obstacle check on the depth image before a forward move (paper, Section 3.2.2).

    A move is refused when at least `min_pixels` valid depth pixels, seen within the robot's swath and between
    `max_height_m`, lie nearer than `distance_m` ahead of the robot's front. The default leaves 0.15 m after a 0.25 m
    move, so that what stopped the robot is still beyond the depth camera's blind zone at the next look.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = True
    distance_m: float = Field(default=0.40, gt=0, le=2, description="free way needed ahead of the robot's front")
    margin_m: float = Field(default=0.02, ge=0, le=0.5, description="added to the robot's radius on both sides")
    min_height_m: float = Field(default=0.04, ge=0, le=1, description="lower points are floor")
    max_height_m: float = Field(default=1.20, gt=0, le=3, description="higher points pass above the robot")
    min_pixels: int = Field(default=40, ge=1, description="fewer pixels are noise")


class ProtocolParameters(BaseModel):
    """What makes trials comparable: two campaigns with equal parameters ask the same question.

    Versions: 1 measured the distance to a goal straight through walls; 2 measures it in sight. A campaign keeps the
    version that it was judged by.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    version: Literal[1, 2] = Field(default=2, description="2: distance in sight; 1: straight through walls")

    max_actions: int = Field(default=150, ge=1, le=100_000, description="an episode ends at this action")
    success_distance_m: float = Field(default=1.0, gt=0, le=10, description="STOP nearer than this succeeds")
    forward_m: float = Field(default=0.25, gt=0, le=2, description="length of MOVE_FORWARD and MOVE_BACKWARD")
    turn_deg: float = Field(default=30.0, gt=0, le=180, description="angle of TURN_LEFT and TURN_RIGHT")
    depth_guard: DepthGuard = Field(default_factory=DepthGuard)
    placement: PlacementTolerance = Field(
        default_factory=PlacementTolerance, description="how far off its mark a robot that was placed may stand"
    )

    @model_serializer(mode="wrap")
    def _without_the_usual_tolerance(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave the usual tolerance out: campaigns keep the hash that they had before there was one."""
        content: dict[str, Any] = serialize(self)
        if self.placement == PlacementTolerance():
            content.pop("placement", None)
        return content

    @property
    def in_sight(self) -> bool:
        """Whether the distance to a goal is measured along lines that no wall crosses."""
        return self.version >= 2

    @classmethod
    def from_record(cls, content: Mapping[str, Any]) -> Self:
        """Return what a record holds; parameters without a version are from before there were versions: the first.

        Raises:
            pydantic.ValidationError: the content is none of ours.
        """
        known = {name: value for name, value in content.items() if name != "starting_positions"}
        return cls.model_validate({"version": 1} | known)
