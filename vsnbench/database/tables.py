"""The tables of the record (what was planned, what happened, how it was judged) as SQLAlchemy models.

Times are aware and in UTC; poses are REP-103 (metres, radians); an unknown number is NULL, never NaN.
"""

from datetime import datetime
from typing import Any

from sqlalchemy import (
    BigInteger,
    CheckConstraint,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    Text,
    UniqueConstraint,
    text,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from vsnbench.database.column_types import JsonValue, UtcDateTime

NAMING_CONVENTION = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


class Base(DeclarativeBase):
    """Registry of the tables; constraint names follow one convention so that migrations can name them."""

    metadata = MetaData(naming_convention=NAMING_CONVENTION)
    type_annotation_map = {  # noqa: RUF012 - SQLAlchemy reads it from the class
        str: Text,
        datetime: UtcDateTime,
        dict[str, Any]: JsonValue,
        list[str]: JsonValue,
    }


class Site(Base):
    """A surveyed place, whole, as it was when the campaign began."""

    __tablename__ = "site"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    title: Mapped[str]
    sha256: Mapped[str] = mapped_column(unique=True)
    content: Mapped[dict[str, Any]]


class Robot(Base):
    """A robot as the thing at the other end says who it is: never as somebody typed its name."""

    __tablename__ = "robot"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    title: Mapped[str]
    kind: Mapped[str]
    """`simulated`, `ros1`, `package.module:Class` of a plug-in, or `imported`."""
    simulated: Mapped[bool]
    sha256: Mapped[str] = mapped_column(unique=True)
    """Hash of kind, profile, code, and whether it is simulated."""
    profile: Mapped[dict[str, Any]]


class Model(Base):
    """A policy with its weights and settings: another checkpoint or another setting is another model."""

    __tablename__ = "model"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    sha256: Mapped[str] = mapped_column(unique=True)
    weights_sha256: Mapped[str]
    weights_label: Mapped[str]
    files: Mapped[dict[str, Any]]
    """SHA-256 of the files that were handed to it, by what they were handed over as (`weights`, `model_config`)."""
    code: Mapped[dict[str, Any]]
    """Its class, the hash of its source, its package's version and commit; empty for what vsnbench brings along."""
    settings: Mapped[dict[str, Any]]
    goals: Mapped[list[str] | None]
    """The goal categories it knows; NULL for any."""
    sensors: Mapped[list[str]]
    surveyed: Mapped[bool]
    """It was handed the site: an upper bound, not a competitor."""


class Process(Base):
    """One process that wrote here: the provenance of what it wrote, and how to tell whether it still lives."""

    __tablename__ = "process"

    id: Mapped[int] = mapped_column(primary_key=True)
    host: Mapped[str]
    pid: Mapped[int]
    boot_id: Mapped[str]
    """Identity of the running kernel; a process of another boot of this machine is dead."""
    pid_namespace: Mapped[str]
    """Process ids of different containers cannot be compared."""
    start_ticks: Mapped[int] = mapped_column(BigInteger)
    """The kernel's start time of the process: tells it from a later one with the same pid."""
    started_at: Mapped[datetime]
    operator: Mapped[str]
    command: Mapped[str]
    vsnbench_version: Mapped[str]
    git_commit: Mapped[str]
    """Commit of the checkout vsnbench ran from; empty for an installed release."""
    git_dirty: Mapped[bool]
    packages: Mapped[dict[str, Any]]
    """Installed package -> version."""
    platform: Mapped[dict[str, Any]]
    """Operating system, interpreter and processor."""


class Campaign(Base):
    """A condition (model, robot, site, protocol, conditions) and a seed; its plan is its trials, and may grow."""

    __tablename__ = "campaign"

    id: Mapped[int] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(unique=True)
    """Hash of the condition and the seed: whoever asks for more of the same finds the same campaign."""
    name: Mapped[str]
    created_at: Mapped[datetime]
    site_id: Mapped[int] = mapped_column(ForeignKey("site.id"), index=True)
    robot_id: Mapped[int] = mapped_column(ForeignKey("robot.id"), index=True)
    model_id: Mapped[int] = mapped_column(ForeignKey("model.id"), index=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"))
    """The process that created it; each episode names its own."""
    protocol: Mapped[dict[str, Any]]
    protocol_sha256: Mapped[str]
    conditions: Mapped[dict[str, Any]]
    """What else results depend on, as the robot says: `noise` (settings of simulated noise; absent for none), filters,
    command lag, the simulator's version."""
    seed: Mapped[int] = mapped_column(BigInteger)


class Trial(Base):
    """One planned cell of a campaign: a goal, a starting position and a repetition."""

    __tablename__ = "trial"
    __table_args__ = (
        UniqueConstraint("campaign_id", "goal", "start", "repetition"),
        CheckConstraint("repetition >= 1", name="repetition_from_one"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id"))
    goal: Mapped[str]
    start: Mapped[int]
    """Number of the starting position."""
    repetition: Mapped[int]
    """From 1."""
    rank: Mapped[int]
    """In which order the trials were planned, from 0."""


class Session(Base):
    """One operator with one robot for a stretch of time; where nobody stood beside the robot there is none."""

    __tablename__ = "session"

    id: Mapped[int] = mapped_column(primary_key=True)
    uuid: Mapped[str] = mapped_column(unique=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"), index=True)
    robot_id: Mapped[int] = mapped_column(ForeignKey("robot.id"))
    operator: Mapped[str]
    """Who said go; at the page, the name signed in with."""
    began_at: Mapped[datetime]
    ended_at: Mapped[datetime | None]
    """NULL while it lasts."""
    words: Mapped[str]
    """Why it ended, where that is worth a word."""


_ACTIVE = text("state IN ('claimed', 'placed', 'running')")


class Episode(Base):
    """One attempt at a trial; `end_reason` is NULL until it has ended."""

    __tablename__ = "episode"
    __table_args__ = (
        CheckConstraint("(end_reason IS NULL) = (ended_at IS NULL)", name="ends_with_a_reason"),
        CheckConstraint(
            "state IN ('claimed', 'placed', 'running', 'awaiting', 'judged', 'void') "
            "AND (state IN ('claimed', 'placed', 'running')) = (end_reason IS NULL)",
            name="state_fits_the_end",
        ),
        # Nobody claims a trial that somebody is at, whatever any program believes.
        Index("uq_episode_active_trial_id", "trial_id", unique=True, sqlite_where=_ACTIVE, postgresql_where=_ACTIVE),
        {"sqlite_autoincrement": True},  # a number, once given, names a directory: it is never given again
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    uuid: Mapped[str] = mapped_column(unique=True)
    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id"), index=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"), index=True)
    session_id: Mapped[int | None] = mapped_column(ForeignKey("session.id"), index=True)
    """NULL where nobody stood beside the robot, and in what was run before sessions were kept."""
    origin: Mapped[str]
    """`run`, or `imported` from another tool."""
    state: Mapped[str]
    """`claimed`, `placed`, `running`, `awaiting` (a person's judgement), `judged` or `void`."""
    lease_until: Mapped[datetime | None]
    """Until when its process holds it without another sign of life; NULL once it has ended."""
    seed: Mapped[int] = mapped_column(BigInteger)
    started_at: Mapped[datetime]
    """When it began; before that, when it was claimed."""
    ended_at: Mapped[datetime | None]
    end_reason: Mapped[str | None]
    """A value of `vsnbench.protocol.judge.EndReason`, as it ended; a later verdict may know better."""
    error: Mapped[str]
    """What went wrong, in words, for the void endings."""
    actions: Mapped[int]
    path_length_m: Mapped[float | None]
    geodesic_start_m: Mapped[float | None]
    """Shortest way from the start to where the goal counts as reached."""
    geodesic_end_m: Mapped[float | None]
    """The same from where it ended."""
    duration_s: Mapped[float | None]
    """On the robot's clock."""
    wall_duration_s: Mapped[float | None]
    distance_to_goal_m: Mapped[float | None]
    distance_source: Mapped[str | None]
    """A value of `vsnbench.protocol.fix.PoseSource`."""
    goal_instance: Mapped[str | None]
    """The site's id of the nearest instance."""
    goal_in_sight: Mapped[bool | None]
    """False where walls hid every instance: the distance is then the straight one. NULL: not known."""
    start_x_m: Mapped[float | None]
    start_y_m: Mapped[float | None]
    start_heading_rad: Mapped[float | None]
    start_source: Mapped[str | None]
    """How the pose at the start is known: a value of `vsnbench.protocol.fix.PoseSource`."""
    final_x_m: Mapped[float | None]
    final_y_m: Mapped[float | None]
    final_heading_rad: Mapped[float | None]
    final_source: Mapped[str | None]
    images_directory: Mapped[str]
    """Relative to the results directory; empty when no images were kept."""


class Step(Base):
    """One action of the policy: what was seen, requested, executed and measured."""

    __tablename__ = "step"
    __table_args__ = (
        CheckConstraint("number >= 1", name="number_from_one"),
        Index("ix_step_actions", "episode_id", "raw_action", "action", "blocked"),  # action histograms read only this
        {"sqlite_with_rowid": False},  # rows lie in the order in which episodes are read
    )

    episode_id: Mapped[int] = mapped_column(ForeignKey("episode.id"), primary_key=True, autoincrement=False)
    number: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    """From 1; STOP and blocked actions count."""
    raw_action: Mapped[str]
    action: Mapped[str]
    blocked: Mapped[bool]
    """The depth guard refused it: counted, not executed."""
    completed: Mapped[bool]
    failure: Mapped[str]
    recorded_at: Mapped[datetime]
    stamp_s: Mapped[float | None]
    """When the image was taken, on the robot's clock."""
    observed_x_m: Mapped[float | None]
    observed_y_m: Mapped[float | None]
    observed_heading_rad: Mapped[float | None]
    """Odometry with the observation, relative to the start of the episode."""
    after_x_m: Mapped[float | None]
    after_y_m: Mapped[float | None]
    after_heading_rad: Mapped[float | None]
    """Odometry after the motion, relative to the start of the episode."""
    world_x_m: Mapped[float | None]
    world_y_m: Mapped[float | None]
    world_heading_rad: Mapped[float | None]
    """Pose in the site after the motion, where it is known."""
    world_source: Mapped[str | None]
    displacement_m: Mapped[float | None]
    turn_rad: Mapped[float | None]
    duration_s: Mapped[float | None]
    corrections: Mapped[int]
    collision_source: Mapped[str | None]
    collision_touched: Mapped[str | None]
    rgb_digest: Mapped[str | None]
    """Of the RGB pixels as the policy saw them; NULL where nobody did (`vsnbench.protocol.image_digest`)."""
    depth_digest: Mapped[str | None]
    """Of the depth in 16-bit millimetres, little-endian; NULL without depth."""
    sense_s: Mapped[float | None]
    infer_s: Mapped[float | None]
    move_s: Mapped[float | None]
    """Wall time of sensing, inference and motion."""
    probabilities: Mapped[dict[str, Any] | None]
    details: Mapped[dict[str, Any] | None]


class Event(Base):
    """Something worth knowing that is not a step: an intervention, a resumption, a warning."""

    __tablename__ = "event"

    id: Mapped[int] = mapped_column(primary_key=True)
    campaign_id: Mapped[int | None] = mapped_column(ForeignKey("campaign.id"), index=True)
    episode_id: Mapped[int | None] = mapped_column(ForeignKey("episode.id"), index=True)
    step_number: Mapped[int | None]
    created_at: Mapped[datetime]
    kind: Mapped[str]
    author: Mapped[str]
    """Who did it; empty for what nobody did, and where it is not known."""
    text: Mapped[str]


class Verdict(Base):
    """A judgement of an episode, or a proposal for one; append-only, the latest judgement stands."""

    __tablename__ = "verdict"
    __table_args__ = (Index(None, "episode_id", "proposed", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    episode_id: Mapped[int] = mapped_column(ForeignKey("episode.id"))
    created_at: Mapped[datetime]
    proposed: Mapped[bool]
    """The protocol's own estimate of a real robot's result: it never stands, a person confirms or overrules it."""
    success: Mapped[bool | None]
    """NULL for a void attempt."""
    end_reason: Mapped[str]
    distance_m: Mapped[float | None]
    distance_source: Mapped[str | None]
    goal_instance: Mapped[str | None]
    goal_in_sight: Mapped[bool | None]
    """As in `episode`."""
    author: Mapped[str]
    """Who judged: an operator's name, or `vsnbench`."""
    source: Mapped[str]
    """`protocol` (the judge), `person`, `recovery` or `import`."""
    reason: Mapped[str]
    """The judgement in words."""
    note: Mapped[str]
    """Why the author judged so, in the author's own words; may be empty."""
