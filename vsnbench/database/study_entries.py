"""What a study is to the record, as plain values: what is locked, what is read back, what was done to it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from vsnbench.database.campaign_plan import CampaignPlan, Trial
from vsnbench.database.lifecycle import EpisodeState

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
"""Letters."""


@dataclass(frozen=True, slots=True)
class LockedArm:
    """One arm as it is locked: its code, and its condition with the trials that are planned."""

    name: str
    code: str
    plan: CampaignPlan


@dataclass(frozen=True, slots=True)
class LockedTrial:
    """A trial in its place: of the arm `arm`."""

    rank: int
    block: int
    arm: str
    goal: str
    start: int
    repetition: int


@dataclass(frozen=True, slots=True)
class StudyLock:
    """Everything that a lock freezes."""

    title: str
    content: str
    sha256: str
    schedule_sha256: str
    seed: int
    blind: bool
    arms: Sequence[LockedArm]
    trials: Sequence[LockedTrial]


@dataclass(frozen=True, slots=True)
class StudyChange:
    """An amendment: the text that is the plan from now on, what changed in it, and why."""

    content: str
    sha256: str
    title: str
    reason: str
    lines: str


@dataclass(frozen=True, slots=True)
class RecordedArm:
    """An arm as the record knows it."""

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
    """Something that was done to a study."""

    created_at: datetime
    kind: str
    author: str
    reason: str
    text: str
    results: int
    """Trials that had a result by then."""
    process_id: int


@dataclass(frozen=True, slots=True)
class RecordedStudy:
    """A study as the record knows it."""

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
    """In the order of their codes."""
    entries: tuple[StudyEntryRow, ...]

    @property
    def is_blind(self) -> bool:
        """Whether people see codes now."""
        return self.blind and self.unblinded_at is None

    def shown(self, arm: str) -> str:
        """Return what an arm is called to people now."""
        if not self.is_blind:
            return arm
        return f"arm {self.by_name[arm].code}"

    def gives_away(self, words: str) -> bool:
        """Whether these words name a model to people who are blind now; a name of a letter or two is in every word."""
        known = {word.lower() for arm in self.arms for word in (arm.name, arm.model, arm.weights_label) if word}
        said = words.lower()
        by_itself = set(re.findall("[a-z0-9]+", said))
        return self.is_blind and any(word in (said if len(word) > _IN_EVERY_WORD else by_itself) for word in known)

    @property
    def by_name(self) -> Mapping[str, RecordedArm]:
        """The arms by their names."""
        return {arm.name: arm for arm in self.arms}


@dataclass(frozen=True, slots=True)
class StudyTrialStanding:
    """A scheduled trial and what has become of it."""

    rank: int
    block: int
    arm: str
    trial: Trial
    episode_id: int | None
    """The episode that counts, or is at it; None while the trial is left."""
    state: EpisodeState | None
    success: bool | None
    here: bool
    voids: int
    """Void attempts at it."""
    results: int = 0
    """Results of it: more than one where records were merged in which it was run; the first alone counts."""
    started_at: datetime | None = None
    operator: str = ""

    @property
    def left(self) -> bool:
        """Nobody has done it or is at it."""
        return self.state is None

    @property
    def done(self) -> bool:
        """It has a result, judged or not yet."""
        return self.state in (EpisodeState.AWAITING, EpisodeState.JUDGED)
