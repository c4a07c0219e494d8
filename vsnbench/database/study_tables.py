"""The tables of studies: the locked plan, its arms, its schedule, and what was done to it since."""

from datetime import datetime

from sqlalchemy import BigInteger, ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from vsnbench.database.tables import Base


class Study(Base):
    """A locked plan over several arms."""

    __tablename__ = "study"

    id: Mapped[int] = mapped_column(primary_key=True)
    uuid: Mapped[str] = mapped_column(unique=True)
    title: Mapped[str]
    content: Mapped[str]
    """The file as it was locked, or last amended."""
    sha256: Mapped[str]
    """Of `content`."""
    locked_sha256: Mapped[str]
    """Of the file as it was locked."""
    schedule_sha256: Mapped[str]
    """Of the whole schedule with the codes."""
    seed: Mapped[int] = mapped_column(BigInteger)
    blind: Mapped[bool]
    """People see codes until `unblinded_at`."""
    locked_at: Mapped[datetime]
    unblinded_at: Mapped[datetime | None]
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"))
    """Who locked it."""


class StudyArm(Base):
    """One of the models that a study compares: a campaign that is the study's alone."""

    __tablename__ = "study_arm"
    __table_args__ = (UniqueConstraint("study_id", "name"), UniqueConstraint("study_id", "code"))

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("study.id"))
    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id"), unique=True)
    name: Mapped[str]
    code: Mapped[str]
    """A letter: what people see in place of the model while they are blind."""


class StudyTrial(Base):
    """A trial in its place in the schedule."""

    __tablename__ = "study_trial"
    __table_args__ = (UniqueConstraint("study_id", "rank"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("study.id"))
    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id"), unique=True)
    rank: Mapped[int]
    """From 0."""
    block: Mapped[int]
    """From 0: the arms' trials on one cell."""


class StudyEntry(Base):
    """Something that was done to a study; append-only."""

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
    """What changed, in an amendment line by line."""
    results: Mapped[int]
    """Trials that had a result by then."""
