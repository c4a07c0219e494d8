"""The numbers of the protocol as data; the defaults are the paper's (Section 4.1)."""

from pydantic import BaseModel, ConfigDict, Field


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
    """What makes trials comparable: two campaigns with equal parameters ask the same question."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    max_actions: int = Field(default=150, ge=1, le=100_000, description="an episode ends at this action")
    success_distance_m: float = Field(default=1.0, gt=0, le=10, description="STOP nearer than this succeeds")
    forward_m: float = Field(default=0.25, gt=0, le=2, description="length of MOVE_FORWARD and MOVE_BACKWARD")
    turn_deg: float = Field(default=30.0, gt=0, le=180, description="angle of TURN_LEFT and TURN_RIGHT")
    starting_positions: int = Field(default=15, ge=1, description="positions a site should have")
    depth_guard: DepthGuard = Field(default_factory=DepthGuard)
