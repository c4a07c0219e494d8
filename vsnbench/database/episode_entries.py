"""What a writer hands over about one episode beside its steps: how it begins and ends, as plain values."""

from dataclasses import dataclass
from datetime import datetime

from vsnbench.protocol.fix import Fix
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.placement import MeasuredPlacement

INTERVENTION = "intervention"
"""Kind of the events that say that a person acted on a real robot outside the protocol's placing: stopped it with the
emergency key or Ctrl-C, called a collision that it did not feel, took it by hand out of where it had failed."""


@dataclass(frozen=True, slots=True)
class EpisodeBegin:
    """What is known of an episode when its robot has been placed and it begins."""

    geodesic_m: float | None = None
    """Shortest way from the start to where the goal counts as reached."""
    started_at: datetime | None = None
    """Now, when not given."""
    has_images: bool = True
    """False where nothing will lie in its directory."""
    measured: MeasuredPlacement | None = None
    """Where the robot stood when a person said go, as it was measured; None where it was not."""


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
