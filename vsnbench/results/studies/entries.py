"""Value types of studies in the record: locked plan, recorded study, entries and progress."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from vsnbench.protocol.scheduled_trial import ScheduledTrial
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.lifecycle import EpisodeState

LOCK, AMEND, UNBLIND, SESSION, SESSION_END, SUSPEND, OVER = (
    "lock",
    "amend",
    "unblind",
    "session",
    "session-end",
    "suspend",
    "over",
)
"""Kinds of entries."""
_IN_EVERY_WORD = 2
"""Length up to which a model name occurs in ordinary words."""


@dataclass(frozen=True, slots=True)
class LockedArm:
    """An arm at the lock: its code, its condition and the planned trials."""

    name: str
    code: str
    plan: CampaignPlan


@dataclass(frozen=True, slots=True)
class StudyLock:
    """Content of a lock."""

    title: str
    content: str
    sha256: str
    schedule_sha256: str
    seed: int
    blind: bool
    arms: Sequence[LockedArm]
    trials: Sequence[ScheduledTrial]


@dataclass(frozen=True, slots=True)
class StudyChange:
    """An amendment: the new text of the plan, the changes and the reason."""

    content: str
    sha256: str
    title: str
    reason: str
    lines: str


@dataclass(frozen=True, slots=True)
class RecordedArm:
    """An arm in the record."""

    name: str
    code: str
    campaign_id: int
    campaign_key: str
    model_sha256: str
    model: str
    weights_label: str
    weights_sha256: str
    surveyed: bool


@dataclass(frozen=True, slots=True)
class StudyEntryRow:
    """An entry in the history of a study."""

    created_at: datetime
    kind: str
    author: str
    reason: str
    text: str
    results: int
    """Number of trials with a result at that time."""
    process_id: int


@dataclass(frozen=True, slots=True)
class RecordedStudy:
    """A study in the record."""

    id: int
    uuid: str
    title: str
    content: str
    sha256: str
    locked_sha256: str
    schedule_sha256: str
    blind: bool
    locked_at: datetime
    unblinded_at: datetime | None
    arms: tuple[RecordedArm, ...]
    """Ordered by code."""
    entries: tuple[StudyEntryRow, ...]

    @property
    def is_blind(self) -> bool:
        """Whether the arms are currently shown as codes."""
        return self.blind and self.unblinded_at is None

    def shown(self, arm: str) -> str:
        """Return the displayed name of an arm."""
        if not self.is_blind:
            return arm
        return f"arm {self.by_name[arm].code}"

    def reveals_arm(self, words: str) -> bool:
        """Whether a text names a model of a blinded study; names of one or two letters are ignored."""
        known = {word.lower() for arm in self.arms for word in (arm.name, arm.model, arm.weights_label) if word}
        text = words.lower()
        by_itself = set(re.findall("[a-z0-9]+", text))
        return self.is_blind and any(word in (text if len(word) > _IN_EVERY_WORD else by_itself) for word in known)

    @property
    def by_name(self) -> Mapping[str, RecordedArm]:
        """Arms by name."""
        return {arm.name: arm for arm in self.arms}


@dataclass(frozen=True, slots=True)
class StudyTrialProgress:
    """A scheduled trial and its state."""

    rank: int
    block: int
    arm: str
    trial: Trial
    episode_id: int | None
    """Episode that counts or is active; None if the trial is open."""
    state: EpisodeState | None
    success: bool | None
    here: bool
    voids: int
    """Number of void attempts."""
    results: int = 0
    """Number of results; merged records can have several, of which the first counts."""
    started_at: datetime | None = None
    operator: str = ""
    progress: float | None = None
    """Progress of the result; None without one, or if a length is unknown."""

    @property
    def left(self) -> bool:
        """Whether the trial has no active episode and no result."""
        return self.state is None

    @property
    def done(self) -> bool:
        """Whether the trial has a result, judged or not."""
        return self.state in (EpisodeState.AWAITING, EpisodeState.JUDGED)
