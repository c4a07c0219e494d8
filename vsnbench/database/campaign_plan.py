"""What a campaign is: a condition and a seed, the trials that are asked for, and what has become of them."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from vsnbench.database.engine import to_json
from vsnbench.database.lifecycle import ACTIVE, EpisodeState
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.protocol.site import Site


def content_sha256(content: object) -> str:
    """Return the hash of a JSON value that does not depend on the order of its keys."""
    return hashlib.sha256(to_json(content, in_order=True).encode()).hexdigest()


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
        content = [self.name, self.weights_sha256, dict(self.settings), self.surveyed]
        # A commit that changes nothing of the source makes no other model.
        code = {name: value for name, value in self.code.items() if name != "commit"}
        return content_sha256([*content, dict(self.files), code] if self.files or code else content)


@dataclass(frozen=True, slots=True)
class PlannedTrial:
    """One cell of a plan; `repetition` counts from 1."""

    goal: str
    start: int
    repetition: int = 1


def trial_seed(campaign_seed: int, goal: str, start: int, repetition: int) -> int:
    """Return the seed of a trial's episodes: of the trial itself, whatever the order it is run in."""
    text = f"{campaign_seed}/{goal}/{start}/{repetition}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


@dataclass(frozen=True, slots=True)
class CampaignPlan:
    """A condition, a seed, and the trials that somebody asks for; equal conditions and seeds are one campaign.

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
    conditions: Mapping[str, Any] = field(default_factory=dict)
    """What else results depend on, as the robot says."""
    name: str = ""
    """For people; the key does not depend on it."""

    def __post_init__(self) -> None:
        if not self.trials:
            raise ValueError("a campaign needs at least one trial")
        if len(set(self.trials)) != len(self.trials):
            raise ValueError("a trial is planned twice")

    @property
    def protocol_sha256(self) -> str:
        """Hash of the protocol's parameters."""
        return content_sha256(self.protocol.model_dump(mode="json"))

    @property
    def key(self) -> str:
        """Hash of the condition and the seed; the trials are the campaign's plan, and no part of it."""
        return content_sha256(
            [
                self.site.sha256,
                self.robot.sha256,
                self.model.sha256,
                self.protocol_sha256,
                dict(self.conditions),
                self.seed,
            ]
        )


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial as the database knows it."""

    id: int
    campaign_id: int
    goal: str
    start: int
    repetition: int


@dataclass(frozen=True, slots=True)
class OpenCampaign:
    """A campaign as somebody goes on with it: what was asked for now, out of all that was ever planned."""

    id: int
    key: str
    name: str
    seed: int
    resumed: bool
    """It was there before."""
    trials: tuple[Trial, ...]
    """Those that the plan asks for, in the plan's order; the campaign may have more."""
    added: int
    """How many of them were not planned before."""


@dataclass(frozen=True, slots=True)
class TrialStanding:
    """What has become of a trial, by its first episode that is not void."""

    trial: Trial
    episode_id: int | None
    state: EpisodeState | None
    """None while the trial is left."""
    success: bool | None
    """None unless it is judged."""
    here: bool
    """This process is at it, or has done it."""
    holder: str = ""
    """The process that is at it, or has done it, for people; empty while the trial is left."""


@dataclass(frozen=True, slots=True)
class CampaignStanding:
    """What has become of the trials that somebody asked for."""

    trials: tuple[TrialStanding, ...]

    @property
    def left(self) -> tuple[Trial, ...]:
        """Trials that nobody has done or is at, in the order of the plan."""
        return tuple(one.trial for one in self.trials if one.state is None)

    @property
    def elsewhere(self) -> tuple[TrialStanding, ...]:
        """Trials that another process is at: neither done nor left."""
        return tuple(one for one in self.trials if one.state in ACTIVE and not one.here)

    @property
    def awaiting(self) -> tuple[TrialStanding, ...]:
        """Trials that are done and await a person's judgement."""
        return tuple(one for one in self.trials if one.state is EpisodeState.AWAITING)

    @property
    def outcomes(self) -> tuple[bool, ...]:
        """For each trial that is done and judged, whether it succeeded."""
        return tuple(bool(one.success) for one in self.trials if one.state is EpisodeState.JUDGED)
