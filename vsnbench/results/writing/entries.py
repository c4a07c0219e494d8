"""Values that describe how an episode begins and ends."""

from dataclasses import dataclass
from datetime import datetime

from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.values.fix import Fix
from vsnbench.values.placement import MeasuredPlacement

INTERVENTION = "intervention"
"""Kind of events for operator actions on a real robot other than placing it: emergency stop, Ctrl-C, a reported
collision, or moving the robot by hand."""


@dataclass(frozen=True, slots=True)
class EpisodeBegin:
    """State of an episode at its beginning."""

    geodesic_m: float | None = None
    """Geodesic distance from the start to the region in which the goal counts as reached."""
    started_at: datetime | None = None
    """Default: now."""
    has_images: bool = True
    """False if the episode has no image files."""
    measured: MeasuredPlacement | None = None
    """Measured start pose; None if it was not measured."""


@dataclass(frozen=True, slots=True)
class EpisodeEnd:
    """State of an episode at its end."""

    end_reason: EndReason
    actions: int
    verdict: Verdict | None = None
    """None if an operator has to judge the episode."""
    proposed: bool = False
    """The verdict is a proposal: unless it is void, an operator confirms or overrules it."""
    error: str = ""
    path_length_m: float | None = None
    geodesic_m: float | None = None
    """Geodesic distance from the end to the region in which the goal counts as reached."""
    duration_s: float | None = None
    """On the robot's clock."""
    wall_duration_s: float | None = None
    final: Fix | None = None
    ended_at: datetime | None = None
    """Default: now."""


@dataclass(frozen=True, slots=True)
class RecoveredEpisode:
    """An episode of a dead process, closed as `interrupted`."""

    id: int
    steps: int
    """Number of committed steps."""
    images_directory: str
