"""The shapes in which the record is read: an episode on one line or whole, verdicts, events, campaigns."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from vsnbench.database.lifecycle import EpisodeState
from vsnbench.database.sessions import RecordedPlacement, RecordedSession
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.judge import EndReason


@dataclass(frozen=True, slots=True)
class EpisodeFilter:
    """Which episodes; what is None or empty does not restrict."""

    model: str = ""
    goal: str = ""
    campaign: str = ""
    """The campaign's number, its name, or at least eight digits of the beginning of its key."""
    outcome: str = ""
    """`success`, `failure`, `void`, `running`, `unjudged`, or an end reason."""


OUTCOMES = ("success", "failure", "void", "running", "unjudged", *(reason.value for reason in EndReason))
"""What `EpisodeFilter.outcome` understands."""


@dataclass(frozen=True, slots=True)
class EpisodeSummary:
    """One episode on one line, as its standing verdict sees it."""

    id: int
    uuid: str
    campaign_id: int
    campaign: str
    model: str
    robot: str
    simulated: bool
    """Of the robot."""
    site: str
    goal: str
    start: int
    repetition: int
    origin: str
    state: str
    """A value of `vsnbench.database.lifecycle.EpisodeState`."""
    end_reason: str | None
    """None until it has ended."""
    success: bool | None
    """None for a void, running or unjudged episode."""
    actions: int
    distance_to_goal_m: float | None
    distance_source: str | None
    collision: bool
    path_length_m: float | None
    geodesic_start_m: float | None
    duration_s: float | None
    started_at: datetime
    ended_at: datetime | None
    images_directory: str

    @property
    def outcome(self) -> str:
        """One word: success, failure, void, running or unjudged."""
        match self.state:
            case EpisodeState.JUDGED:
                return "success" if self.success else "failure"
            case EpisodeState.VOID:
                return "void"
            case EpisodeState.AWAITING:
                return "unjudged"
            case _:
                return "running"


@dataclass(frozen=True, slots=True)
class RecordedVerdict:
    """One judgement, or the protocol's proposal for one; the last judgement of an episode stands."""

    created_at: datetime
    proposed: bool
    success: bool | None
    end_reason: str
    distance_m: float | None
    distance_source: str | None
    goal_instance: str | None
    goal_in_sight: bool | None
    author: str
    source: str
    reason: str
    note: str


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """Something that happened beside the steps."""

    created_at: datetime
    step_number: int | None
    kind: str
    author: str
    """Who did it; empty for what nobody did, and where it is not known."""
    text: str


@dataclass(frozen=True, slots=True)
class EpisodeProvenance:
    """What an episode's result depends on."""

    vsnbench_version: str
    git_commit: str
    git_dirty: bool
    host: str
    operator: str
    command: str
    packages: dict[str, str]
    platform: dict[str, str]
    weights_sha256: str
    weights_label: str
    model_files: dict[str, str]
    model_code: dict[str, str]
    model_settings: dict[str, Any]
    robot_kind: str
    robot_profile: dict[str, Any]
    site_sha256: str
    site_content: dict[str, Any]
    protocol: dict[str, Any]
    protocol_sha256: str
    conditions: dict[str, Any]
    campaign_key: str
    campaign_seed: int


@dataclass(frozen=True, slots=True)
class EpisodeDetails:
    """One episode, whole but for its steps."""

    summary: EpisodeSummary
    seed: int
    ended_with: str | None
    """Why it ended, before anybody judged it; None until it has ended."""
    error: str
    goal_instance: str | None
    wall_duration_s: float | None
    geodesic_end_m: float | None
    placement: Fix | None
    """Where the robot stood when it began, and how that is known."""
    measured: RecordedPlacement | None
    """The same as it was measured; None where it was not."""
    session: RecordedSession | None
    """In which it was run; None where nobody stood beside the robot."""
    final: Fix | None
    counts: bool
    """It is the one that stands for its trial."""
    verdicts: tuple[RecordedVerdict, ...]
    events: tuple[RecordedEvent, ...]
    provenance: EpisodeProvenance

    @property
    def standing(self) -> RecordedVerdict | None:
        """The verdict that stands: the latest judgement; None while there is none, or it was taken back."""
        if self.summary.state == EpisodeState.AWAITING:
            return None
        return next((verdict for verdict in reversed(self.verdicts) if not verdict.proposed), None)


@dataclass(frozen=True, slots=True)
class PendingEpisode:
    """An episode that awaits a person's word, with what the protocol proposes."""

    id: int
    model: str
    robot: str
    goal: str
    start: int
    repetition: int
    origin: str
    end_reason: str
    ended_at: datetime
    proposal: str | None
    """None where there is none: an import."""
    proposed_success: bool | None


@dataclass(frozen=True, slots=True)
class CampaignState:
    """How far a campaign has come."""

    id: int
    key: str
    name: str
    created_at: datetime
    model: str
    robot: str
    simulated: bool
    """Of the robot."""
    site: str
    seed: int
    trials: int
    done: int
    """Trials with an episode that counts."""
