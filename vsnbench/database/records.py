"""What a writer hands to the journal: a plan, an episode's start, its steps and its end, as plain values."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from vsnbench.database.engine import to_json
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.protocol.site import Site


def content_sha256(content: object) -> str:
    """Return the hash of a JSON value that does not depend on the order of its keys."""
    return hashlib.sha256(to_json(_sorted(content)).encode()).hexdigest()


def _sorted(content: object) -> object:
    if isinstance(content, Mapping):
        return {str(key): _sorted(content[key]) for key in sorted(content, key=str)}
    if isinstance(content, list | tuple):
        return [_sorted(item) for item in content]
    return content


@dataclass(frozen=True, slots=True)
class ModelIdentity:
    """A policy with its weights and settings, as far as results depend on them."""

    name: str
    goals: frozenset[str] | None = None
    sensors: frozenset[str] = frozenset()
    weights_sha256: str = ""
    weights_label: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    surveyed: bool = False
    """It is handed the site."""
    files: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of the files that were handed to it, by what they were handed over as."""
    code: Mapping[str, str] = field(default_factory=dict)
    """Of a third party's policy: its class, the hash of its source, its package's version and commit."""

    @property
    def sha256(self) -> str:
        """Hash of what tells one model from another: name, weights, settings, files and code."""
        told = [self.name, self.weights_sha256, dict(self.settings), self.surveyed]
        # A commit that changes nothing of the source makes no other model.
        code = {name: value for name, value in self.code.items() if name != "commit"}
        return content_sha256([*told, dict(self.files), code] if self.files or code else told)


@dataclass(frozen=True, slots=True)
class PlannedTrial:
    """One cell of a plan; `repetition` counts from 1."""

    goal: str
    start: int
    repetition: int = 1


@dataclass(frozen=True, slots=True)
class CampaignPlan:
    """Everything that a campaign fixes in advance; equal plans are one campaign.

    Raises:
        ValueError: no trials, or one of them twice.
    """

    site: Site
    robot: RobotIdentity
    model: ModelIdentity
    protocol: ProtocolParameters
    seed: int
    trials: Sequence[PlannedTrial]
    """In the order in which they are to be run."""
    noise: Mapping[str, Any] = field(default_factory=dict)
    shuffled: bool = False
    name: str = ""
    """For people; the key does not depend on it."""

    def __post_init__(self) -> None:
        if not self.trials:
            raise ValueError("a campaign needs at least one trial")
        if len(set(self.trials)) != len(self.trials):
            raise ValueError("a trial is planned twice")

    @property
    def goals(self) -> list[str]:
        """The goal categories, in the order of the trials' first mention."""
        return list(dict.fromkeys(trial.goal for trial in self.trials))

    @property
    def starts(self) -> list[int]:
        """The starting positions, ascending."""
        return sorted({trial.start for trial in self.trials})

    @property
    def repetitions(self) -> int:
        """How often each cell is tried."""
        return max(trial.repetition for trial in self.trials)

    @property
    def protocol_sha256(self) -> str:
        """Hash of the protocol's parameters."""
        return content_sha256(self.protocol.model_dump(mode="json"))

    @property
    def key(self) -> str:
        """Hash by which the same command finds its campaign again; the order of the trials is not part of it."""
        cells = sorted((trial.goal, trial.start, trial.repetition) for trial in self.trials)
        return content_sha256(
            [
                self.site.sha256,
                self.robot.sha256,
                self.model.sha256,
                self.protocol_sha256,
                dict(self.noise),
                self.seed,
                cells,
            ]
        )


@dataclass(frozen=True, slots=True)
class TrialRecord:
    """A trial as the database knows it."""

    id: int
    goal: str
    start: int
    repetition: int
    place: int
    """Rank in the campaign's order, from 0."""


@dataclass(frozen=True, slots=True)
class CampaignRecord:
    """A campaign as the database knows it."""

    id: int
    key: str
    name: str
    created_at: datetime
    resumed: bool
    """It was there before."""
    trials: tuple[TrialRecord, ...]
    """All of them, in order."""


@dataclass(frozen=True, slots=True)
class EpisodeStart:
    """What is known of an episode when it begins."""

    trial_id: int
    seed: int
    pose: Pose | None = None
    """Start in the site's frame."""
    geodesic_m: float | None = None
    """Shortest way from the start to where the goal counts as reached."""
    keeps_images: bool = True
    origin: str = "run"
    started_at: datetime | None = None
    """Now, when not given."""
    uuid: str = ""
    """A fresh one, when not given."""


@dataclass(frozen=True, slots=True)
class EpisodeHandle:
    """An episode that has begun."""

    id: int
    uuid: str
    images_directory: str
    """Relative to the results directory; empty when no images are kept."""


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
