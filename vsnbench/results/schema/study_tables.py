"""Tables of studies: the locked plan, its arms, its schedule and its history."""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from vsnbench.results.schema.base import TableBase


class Study(TableBase):
    """A locked plan of several arms."""

    __tablename__ = "study"

    id: Mapped[int] = mapped_column(primary_key=True)
    uuid: Mapped[str] = mapped_column(unique=True)
    title: Mapped[str]
    content: Mapped[str]
    """The file as locked or last amended."""
    sha256: Mapped[str]
    """SHA-256 of `content`."""
    locked_sha256: Mapped[str]
    """SHA-256 of the file as locked."""
    schedule_sha256: Mapped[str]
    """SHA-256 of the schedule with the codes."""
    seed: Mapped[int] = mapped_column(BigInteger)
    blind: Mapped[bool]
    """Arms are shown as codes until `unblinded_at`."""
    locked_at: Mapped[datetime]
    unblinded_at: Mapped[datetime | None]
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"))
    """Process that locked it."""
    log_heads: Mapped[str] = mapped_column(server_default="")
    """Hashes of the log's newest events, sorted, separated by spaces; empty for studies from before the log existed."""


class StudyArm(TableBase):
    """An arm of a study: a campaign that belongs to this study only."""

    __tablename__ = "study_arm"
    __table_args__ = (UniqueConstraint("study_id", "name"), UniqueConstraint("study_id", "code"))

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("study.id"))
    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id"), unique=True)
    name: Mapped[str]
    code: Mapped[str]
    """Letter that replaces the model's name in a blinded study."""


class StudyTrial(TableBase):
    """A scheduled trial."""

    __tablename__ = "study_trial"
    __table_args__ = (UniqueConstraint("study_id", "rank"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("study.id"))
    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id"), unique=True)
    rank: Mapped[int]
    """From 0."""
    block: Mapped[int]
    """From 0: the trials of all arms on one cell."""


class StudyEntry(TableBase):
    """An entry in the history of a study; append-only."""

    __tablename__ = "study_entry"

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("study.id"), index=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"))
    created_at: Mapped[datetime]
    kind: Mapped[str]
    """`lock`, `amend`, `unblind`, `session`, `session-end`, `suspend` or `over`."""
    author: Mapped[str]
    reason: Mapped[str]
    text: Mapped[str]
    """Changes; for an amendment line by line."""
    results: Mapped[int]
    """Number of trials with a result at that time."""


class StudyEvent(TableBase):
    """An event of a study's log, chained by hashes to its predecessors; append-only."""

    __tablename__ = "study_event"
    __table_args__ = (UniqueConstraint("study_id", "sha256"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("study.id"))
    created_at: Mapped[datetime]
    kind: Mapped[str]
    """`entry` (a row of `study_entry`) or `outcome` (an episode that ended or was judged)."""
    content: Mapped[str]
    """The event as JSON with sorted keys."""
    previous: Mapped[str]
    """Hashes of the preceding events, sorted, separated by spaces; several after a merge, empty for the first."""
    sha256: Mapped[str]
    """SHA-256 of the other columns, without `id` and `study_id`."""
