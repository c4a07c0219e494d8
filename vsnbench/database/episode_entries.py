"""What a writer hands to the journal about one episode: how it begins, its steps and its end, as plain values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from vsnbench.database.campaign_plan import Trial
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.pose import Pose


@dataclass(frozen=True, slots=True)
class Claim:
    """An episode that this process has taken: nobody else runs its trial until it is released, voided or ended."""

    id: int
    """The episode's number."""
    uuid: str
    trial: Trial
    seed: int
    images_directory: str
    """Relative to the results directory; empty when no images are kept."""


@dataclass(frozen=True, slots=True)
class EpisodeBegin:
    """What is known of an episode when its robot has been placed and it begins."""

    geodesic_m: float | None = None
    """Shortest way from the start to where the goal counts as reached."""
    started_at: datetime | None = None
    """Now, when not given."""


@dataclass(frozen=True, slots=True)
class StepTimings:
    """Wall time that a step took, seconds."""

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
    """None when the depth guard refused the action."""
    observed: Pose | None = None
    """Odometry with the observation, relative to the start of the episode."""
    stamp_s: float | None = None
    world: Fix | None = None
    """Where the robot stands in the site after the motion, if that is known."""
    rgb_sha256: str | None = None
    depth_sha256: str | None = None
    timings: StepTimings = field(default_factory=StepTimings)
    probabilities: Mapping[str, float] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def blocked(self) -> bool:
        """The depth guard refused it."""
        return self.result is None


@dataclass(frozen=True, slots=True)
class EpisodeEnd:
    """What is known of an episode when it has ended."""

    end_reason: EndReason
    actions: int
    verdict: Verdict | None = None
    """None leaves the episode unjudged: a person's word is awaited."""
    proposed: bool = False
    """The verdict is an estimate: unless it is void, the episode awaits a person, who confirms or overrules it."""
    error: str = ""
    path_length_m: float | None = None
    geodesic_m: float | None = None
    """Shortest way from where it ended to where the goal counts as reached."""
    duration_s: float | None = None
    """On the robot's clock."""
    wall_duration_s: float | None = None
    final: Fix | None = None
    ended_at: datetime | None = None
    """Now, when not given."""


@dataclass(frozen=True, slots=True)
class RecoveredEpisode:
    """An episode whose process had died, now closed as `interrupted`."""

    id: int
    goal: str
    start: int
    steps: int
    """Steps that had been committed."""
    images_directory: str
