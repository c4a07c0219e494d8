"""One step as it is kept: the same value when it is written, when it is shown and when it is read back."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.pose import Pose


@dataclass(frozen=True, slots=True)
class StepTimings:
    """Wall time that a step took, seconds; None where it is not known."""

    sense_s: float | None = None
    infer_s: float | None = None
    move_s: float | None = None


@dataclass(frozen=True, slots=True)
class StepRecord:
    """One action of the policy, from the observation to the measured outcome."""

    number: int
    """From 1; STOP and blocked actions count."""
    action: Action
    raw_action: str = ""
    """The model's own word; the action's name when empty."""
    result: MotionResult | None = None
    """None when the depth guard refused the action; numbers that the record does not know are NaN."""
    observed: Pose | None = None
    """Odometry with the observation, relative to the start of the episode."""
    stamp_s: float | None = None
    """When the image was taken, on the robot's clock."""
    world: Fix | None = None
    """Where the robot stands in the site after the motion, if that is known."""
    rgb_digest: str | None = None
    """As `vsnbench.protocol.image_digest` makes it; None where the image was not drawn."""
    depth_digest: str | None = None
    """None without depth."""
    timings: StepTimings = field(default_factory=StepTimings)
    probabilities: Mapping[str, float] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    recorded_at: datetime | None = None
    """When it was written; None before."""

    @property
    def blocked(self) -> bool:
        """The depth guard refused it."""
        return self.result is None

    @property
    def after(self) -> Pose | None:
        """Odometry after the motion, relative to the start; what was refused ends where it began."""
        return self.result.pose if self.result else self.observed
