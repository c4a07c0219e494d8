"""Values that describe how an episode begins and ends."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.stop_pose import StopPose
from vsnbench.values.fix import Fix
from vsnbench.values.placement import MeasuredPlacement

INTERVENTION = "intervention"
"""Kind of events for operator actions on a real robot other than placing it: emergency stop, Ctrl-C, a reported
collision, or moving the robot by hand."""


@dataclass(frozen=True, slots=True)
class EpisodeBegin:
    """State of an episode at its beginning."""

    shortest_m: float | None = None
    """Geodesic distance from the start to the region in which the goal counts as reached."""
    started_at: datetime | None = None
    """Default: now."""
    has_images: bool = True
    """False if the episode has no image files."""
    measured: MeasuredPlacement | None = None
    """Measured start pose; None if it was not measured."""


@dataclass(frozen=True, slots=True)
class EpisodeEnd:
    """How an episode ended; the same value for the runner, the record and a viewer."""

    verdict: Verdict
    actions: int
    final: Fix | None = None
    """Pose at the end."""
    wall_duration_s: float | None = None
    error: str = ""
    """Reason why a void episode is void."""
    proposed: bool = False
    """The verdict is a proposal, because the robot is real: unless it is void, a person confirms or overrules it."""
    began: bool = True
    """False if the episode ended before its first observation."""
    path_m: float | None = None
    """Length of the driven path."""
    remaining_m: float | None = None
    """Geodesic distance from the end to the region in which the goal counts as reached."""
    duration_s: float | None = None
    """On the robot's clock."""
    ended_at: datetime | None = None
    """Default: now."""
    stop: StopPose | None = None
    """Pose measured after STOP; None if it was not measured."""
    unjudged: bool = False
    """Nothing is proposed: the verdict has the end reason only, is not recorded, and a person has to judge."""

    @property
    def end_reason(self) -> EndReason:
        """Why the episode ended."""
        return self.verdict.end_reason


def unjudged_end(reason: EndReason, actions: int, **known: Any) -> EpisodeEnd:
    """Return the end of an episode that a person has to judge; `known` are further fields."""
    return EpisodeEnd(Verdict(reason, None, "not judged yet"), actions, unjudged=True, **known)


@dataclass(frozen=True, slots=True)
class RecoveredEpisode:
    """An episode of a dead process, closed as `interrupted`."""

    id: int
    steps: int
    """Number of committed steps."""
    images_directory: str
