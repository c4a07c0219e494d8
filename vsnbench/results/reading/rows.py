"""Result types of queries: episodes, verdicts, events and campaigns."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from vsnbench.protocol.disturbances import Disturbances
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.metrics import known_progress
from vsnbench.results.goals import RecordedGoal
from vsnbench.results.writing.lifecycle import RESULTS, EpisodeState
from vsnbench.results.writing.sessions import RecordedPlacement, RecordedSession
from vsnbench.values.fix import Fix


@dataclass(frozen=True, slots=True)
class EpisodeFilter:
    """Selection of episodes; empty fields select all."""

    models: tuple[str, ...] = ()
    goals: tuple[str, ...] = ()
    campaign: str = ""
    """Number or name of the campaign, or at least eight leading digits of its key."""
    outcome: str = ""
    """`success`, `failure`, `void`, `running`, `unjudged` or an end reason."""
    tags: tuple[str, ...] = ()
    """Episodes with all of these tags."""
    disturbances: Disturbances | None = None
    """Episodes with exactly these disturbances; None for all episodes."""
    note: str = ""
    """Episodes with these words in a note, or in the note of a verdict."""


OUTCOMES = ("success", "failure", "void", "running", "unjudged", *(reason.value for reason in EndReason))
"""Outcomes that `EpisodeFilter.outcome` accepts."""


@dataclass(frozen=True, slots=True)
class EpisodeSummary:
    """Summary of an episode according to its current verdict."""

    id: int
    uuid: str
    campaign_id: int
    campaign: str
    model: str
    robot: str
    simulated: bool
    """Whether the robot is simulated."""
    site: str
    goal: str
    start: int
    repetition: int
    origin: str
    state: str
    """A value of `vsnbench.results.writing.lifecycle.EpisodeState`."""
    end_reason: str | None
    """None until the episode has ended."""
    success: bool | None
    """None for a void, running or unjudged episode."""
    actions: int
    distance_to_goal_m: float | None
    distance_source: str | None
    collision: bool
    path_length_m: float | None
    geodesic_start_m: float | None
    geodesic_end_m: float | None
    duration_s: float | None
    started_at: datetime
    ended_at: datetime | None
    images_directory: str
    success_distance_m: float | None
    """Success distance of the campaign's protocol; None if it has none."""
    disturbances: str = ""
    """Disturbances of what the model saw, as on the command line: `blur=2`."""
    tags: tuple[str, ...] = ()
    """In alphabetical order."""

    @property
    def progress(self) -> float | None:
        """Share of the shortest path that was covered, 0 to 1; None if a length is unknown or without a result."""
        return known_progress(self.geodesic_start_m, self.geodesic_end_m) if self.state in RESULTS else None

    @property
    def outcome(self) -> str:
        """`success`, `failure`, `void`, `running` or `unjudged`."""
        judged = "success" if self.success else "failure"
        known: dict[str, str] = {
            EpisodeState.JUDGED: judged,
            EpisodeState.VOID: "void",
            EpisodeState.AWAITING: "unjudged",
        }
        return known.get(self.state, "running")


@dataclass(frozen=True, slots=True)
class RecordedVerdict:
    """A judgement, or a proposal of the protocol; the latest judgement is current."""

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
    """An event of an episode."""

    created_at: datetime
    step_number: int | None
    kind: str
    author: str
    """Author of the event; empty without an author."""
    text: str

    @property
    def statement(self) -> str:
        """The text without the number of the action, with which texts of earlier versions begin."""
        return self.text.removeprefix(f"action {self.step_number}: ")


@dataclass(frozen=True, slots=True)
class EpisodeProvenance:
    """Data that an episode's result depends on."""

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
    """All recorded data of an episode except its steps."""

    summary: EpisodeSummary
    seed: int
    ended_with: str | None
    """End reason before any judgement; None until the episode has ended."""
    error: str
    goal_definition: RecordedGoal | None
    """Definition of a goal of the site file; None for a category."""
    goal_instance: str | None
    wall_duration_s: float | None
    placement: Fix | None
    """Start pose and its source."""
    measured: RecordedPlacement | None
    """Measured start pose; None if it was not measured."""
    session: RecordedSession | None
    """Operator session; None without an operator."""
    final: Fix | None
    counts: bool
    """The episode counts for its trial."""
    verdicts: tuple[RecordedVerdict, ...]
    events: tuple[RecordedEvent, ...]
    provenance: EpisodeProvenance

    @property
    def current_verdict(self) -> RecordedVerdict | None:
        """The current verdict; None without a judgement, or if it was retracted."""
        if self.summary.state == EpisodeState.AWAITING:
            return None
        return next((verdict for verdict in reversed(self.verdicts) if not verdict.proposed), None)

    @property
    def proposal(self) -> RecordedVerdict | None:
        """The protocol's latest proposal."""
        return next((verdict for verdict in reversed(self.verdicts) if verdict.proposed), None)


@dataclass(frozen=True, slots=True)
class PendingEpisode:
    """An episode that awaits an operator's judgement, with the protocol's proposal."""

    id: int
    model: str
    robot: str
    goal: str
    start: int
    repetition: int
    origin: str
    end_reason: str
    ended_at: datetime | None
    """None for an arm of a blinded study."""
    proposal: str | None
    """None for an import."""
    proposed_success: bool | None


@dataclass(frozen=True, slots=True)
class CampaignState:
    """Progress of a campaign."""

    id: int
    key: str
    name: str
    created_at: datetime
    model: str
    robot: str
    simulated: bool
    """Whether the robot is simulated."""
    site: str
    seed: int
    trials: int
    done: int
    """Number of trials with an episode that counts."""
    disturbances: str = ""
    """Disturbances of what the model sees, as on the command line: `blur=2`."""

    @property
    def title(self) -> str:
        """The name with the disturbances, which the name does not have."""
        return f"{self.name} with {self.disturbances}" if self.disturbances else self.name
