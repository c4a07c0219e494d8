"""Tables of the record (plans, episodes, verdicts) as SQLAlchemy models.

Times are aware and in UTC; poses follow REP-103 (metres, radians); unknown numbers are NULL, never NaN.
"""

from datetime import datetime
from typing import Any

from sqlalchemy import BigInteger, CheckConstraint, ForeignKey, Index, Integer, LargeBinary, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from vsnbench.results.schema.base import TableBase


class SiteRow(TableBase):
    """A surveyed site with its content at the beginning of the campaign."""

    __tablename__ = "site"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    title: Mapped[str]
    sha256: Mapped[str] = mapped_column(unique=True)
    content: Mapped[dict[str, Any]]


class RobotRow(TableBase):
    """A robot as identified by its driver."""

    __tablename__ = "robot"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    title: Mapped[str]
    kind: Mapped[str]
    """`simulated`, `ros1`, `package.module:Class` of a plug-in, or `imported`."""
    simulated: Mapped[bool]
    sha256: Mapped[str] = mapped_column(unique=True)
    """Hash of kind, profile, code and `simulated`."""
    profile: Mapped[dict[str, Any]]


class ModelRow(TableBase):
    """A policy with its weights and settings; other weights or settings are another model."""

    __tablename__ = "model"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    sha256: Mapped[str] = mapped_column(unique=True)
    weights_sha256: Mapped[str]
    weights_label: Mapped[str]
    files: Mapped[dict[str, Any]]
    """SHA-256 of the files given to the model, by option (`weights`, `model_config`)."""
    code: Mapped[dict[str, Any]]
    """Class, source hash, package version and commit of a user's policy; empty for built-in models."""
    settings: Mapped[dict[str, Any]]
    goals: Mapped[list[str] | None]
    """Supported goal categories; NULL for any."""
    sensors: Mapped[list[str]]
    surveyed: Mapped[bool]
    """The model has access to the site file: an upper bound, not a competitor."""


class ProcessRow(TableBase):
    """A writing process: provenance, and identity to check whether it is alive."""

    __tablename__ = "process"

    id: Mapped[int] = mapped_column(primary_key=True)
    host: Mapped[str]
    pid: Mapped[int]
    boot_id: Mapped[str]
    """Boot id of the kernel; processes of another boot are dead."""
    pid_namespace: Mapped[str]
    """PID namespace, because process ids of different containers cannot be compared."""
    start_ticks: Mapped[int] = mapped_column(BigInteger)
    """Start time in the kernel, which distinguishes processes with the same pid."""
    started_at: Mapped[datetime]
    operator: Mapped[str]
    command: Mapped[str]
    vsnbench_version: Mapped[str]
    git_commit: Mapped[str]
    """Commit of the checkout; empty for an installed release."""
    git_dirty: Mapped[bool]
    packages: Mapped[dict[str, Any]]
    """Installed package -> version."""
    platform: Mapped[dict[str, Any]]
    """Operating system, interpreter and processor; of a process that runs trials also `package_hashes`."""


class CampaignRow(TableBase):
    """A condition (model, robot, site, protocol, conditions) and a seed; its plan of trials may grow."""

    __tablename__ = "campaign"

    id: Mapped[int] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(unique=True)
    """Hash of the condition and the seed, which identifies the campaign."""
    name: Mapped[str]
    created_at: Mapped[datetime]
    site_id: Mapped[int] = mapped_column(ForeignKey("site.id"), index=True)
    robot_id: Mapped[int] = mapped_column(ForeignKey("robot.id"), index=True)
    model_id: Mapped[int] = mapped_column(ForeignKey("model.id"), index=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"))
    """Process that created the campaign; each episode has its own."""
    protocol: Mapped[dict[str, Any]]
    protocol_sha256: Mapped[str]
    conditions: Mapped[dict[str, Any]]
    """Conditions reported by the robot: `noise` (settings of simulated noise, absent without noise), filters, command
    lag, the simulator's version; `disturbances` of what the model sees (value by name, absent without any)."""
    seed: Mapped[int] = mapped_column(BigInteger)


class GoalRow(TableBase):
    """Definition of a goal of a site file; a category of objects has none."""

    __tablename__ = "goal"

    id: Mapped[int] = mapped_column(primary_key=True)
    sha256: Mapped[str] = mapped_column(unique=True)
    """Hash of the content."""
    name: Mapped[str]
    """Id of the goal at its site."""
    kind: Mapped[str]
    """Value of `vsnbench.values.goal.GoalKind`."""
    content: Mapped[dict[str, Any]]
    """Words, hash of the photograph, targets and starting positions, as in the site file."""
    image: Mapped[bytes | None] = mapped_column(LargeBinary)
    """The photograph of an image goal, PNG or JPEG; NULL for other kinds."""


class TrialRow(TableBase):
    """A planned trial: a goal, a starting position and a repetition."""

    __tablename__ = "trial"
    __table_args__ = (
        UniqueConstraint("campaign_id", "goal", "start", "repetition"),
        CheckConstraint("repetition >= 1", name="repetition_from_one"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id"))
    goal: Mapped[str]
    """Category, or id of a goal of the site file."""
    goal_id: Mapped[int | None] = mapped_column(ForeignKey("goal.id"))
    """Definition of the goal; NULL for a category."""
    start: Mapped[int]
    """Number of the starting position."""
    repetition: Mapped[int]
    """From 1."""
    rank: Mapped[int]
    """Order of planning, from 0."""


class SessionRow(TableBase):
    """A session of one operator with one robot."""

    __tablename__ = "session"

    id: Mapped[int] = mapped_column(primary_key=True)
    uuid: Mapped[str] = mapped_column(unique=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"), index=True)
    robot_id: Mapped[int] = mapped_column(ForeignKey("robot.id"))
    operator: Mapped[str]
    """Name of the operator, or the name signed in with on the operator page."""
    began_at: Mapped[datetime]
    ended_at: Mapped[datetime | None]
    """NULL while the session is open."""
    words: Mapped[str]
    """Reason for the end, if any."""


IS_ACTIVE = text("state IN ('claimed', 'placed', 'running')")  # a query with exactly this condition uses the index
_WHERE_ACTIVE: Any = {"sqlite_where": IS_ACTIVE, "postgresql_where": IS_ACTIVE}


class EpisodeRow(TableBase):
    """One attempt at a trial; `end_reason` is NULL until it has ended."""

    __tablename__ = "episode"
    __table_args__ = (
        CheckConstraint("(end_reason IS NULL) = (ended_at IS NULL)", name="ends_with_a_reason"),
        CheckConstraint(
            "state IN ('claimed', 'placed', 'running', 'awaiting', 'judged', 'void') "
            "AND (state IN ('claimed', 'placed', 'running')) = (end_reason IS NULL)",
            name="state_fits_the_end",
        ),
        # The database itself prevents two active episodes of one trial.
        Index("uq_episode_active_trial_id", "trial_id", unique=True, **_WHERE_ACTIVE),
        {"sqlite_autoincrement": True},  # numbers name directories and are never reused
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    uuid: Mapped[str] = mapped_column(unique=True)
    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id"), index=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("process.id"), index=True)
    session_id: Mapped[int | None] = mapped_column(ForeignKey("session.id"), index=True)
    """NULL without an operator, and in old records."""
    origin: Mapped[str]
    """`run`, or `imported` from another tool."""
    state: Mapped[str]
    """`claimed`, `placed`, `running`, `awaiting` (an operator's judgement), `judged` or `void`."""
    lease_until: Mapped[datetime | None]
    """End of the claim unless it is renewed; NULL after the episode has ended."""
    seed: Mapped[int] = mapped_column(BigInteger)
    started_at: Mapped[datetime]
    """Beginning of the episode; before that, time of the claim."""
    ended_at: Mapped[datetime | None]
    end_reason: Mapped[str | None]
    """Value of `vsnbench.protocol.judge.EndReason` at the end; a later verdict may differ."""
    error: Mapped[str]
    """Error message of a void episode."""
    actions: Mapped[int]
    path_length_m: Mapped[float | None]
    geodesic_start_m: Mapped[float | None]
    geodesic_end_m: Mapped[float | None]
    """Geodesic distances from start and end to the region in which the goal counts as reached; NULL for a sequence."""
    duration_s: Mapped[float | None]
    """On the robot's clock."""
    wall_duration_s: Mapped[float | None]
    thinking_s: Mapped[float | None]
    """Wall time of the model's inference, summed over the steps at the end; NULL if a step has none."""
    distance_to_goal_m: Mapped[float | None]
    distance_source: Mapped[str | None]
    """Value of `vsnbench.values.fix.PoseSource`."""
    goal_instance: Mapped[str | None]
    """Id of the nearest instance in the site."""
    goal_in_sight: Mapped[bool | None]
    """False if walls hid every instance, so that the distance is Euclidean. NULL: unknown."""
    start_x_m: Mapped[float | None]
    start_y_m: Mapped[float | None]
    start_heading_rad: Mapped[float | None]
    start_source: Mapped[str | None]
    """Source of the start pose: a value of `vsnbench.values.fix.PoseSource`."""
    final_x_m: Mapped[float | None]
    final_y_m: Mapped[float | None]
    final_heading_rad: Mapped[float | None]
    final_source: Mapped[str | None]
    images_directory: Mapped[str]
    """Relative to the results directory; empty without images."""
    legs: Mapped[list[Any] | None]
    """Goals of a sequence that were given, in order (`results.writing.entries.SequenceLeg`); NULL for another goal."""


class StepRow(TableBase):
    """One action of the policy: observation, request, execution and measurements."""

    __tablename__ = "step"
    __table_args__ = (
        CheckConstraint("number >= 1", name="number_from_one"),
        Index("ix_step_actions", "episode_id", "raw_action", "action", "blocked"),  # covers the action histograms
        {"sqlite_with_rowid": False},  # rows are stored in the order in which episodes are read
    )

    episode_id: Mapped[int] = mapped_column(ForeignKey("episode.id"), primary_key=True, autoincrement=False)
    number: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    """From 1; STOP and blocked actions count."""
    raw_action: Mapped[str]
    action: Mapped[str]
    blocked: Mapped[bool]
    """The depth guard blocked the action: counted but not executed."""
    completed: Mapped[bool]
    failure: Mapped[str]
    """Why the robot did not complete it, or an empty string."""
    recorded_at: Mapped[datetime]
    stamp_s: Mapped[float | None]
    """Time of the image on the robot's clock."""
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
    """Pose in the site after the motion, if known."""
    world_source: Mapped[str | None]
    displacement_m: Mapped[float | None]
    turn_rad: Mapped[float | None]
    duration_s: Mapped[float | None]
    corrections: Mapped[int]
    collision_source: Mapped[str | None]
    collision_touched: Mapped[str | None]
    rgb_digest: Mapped[str | None]
    """Digest of the robot's RGB image, uncropped (`vsnbench.values.encoding.image_digest`); NULL without one."""
    depth_digest: Mapped[str | None]
    """Digest of the depth in 16-bit millimetres, little-endian; NULL without depth."""
    sense_s: Mapped[float | None]
    infer_s: Mapped[float | None]
    move_s: Mapped[float | None]
    """Wall time of sensing, inference and motion."""
    probabilities: Mapped[dict[str, Any] | None]
    details: Mapped[dict[str, Any] | None]
    movement: Mapped[dict[str, Any] | None]
    """Parameters of an action that has some (`vsnbench.values.movement`), `path_m` of what was driven, and `part`
    [number, count] of a chunk; in continuous execution `waiting_s` and `answer`; NULL for a discrete action."""
    rgb_file_digest: Mapped[str | None]
    """Digest of the bytes of the colour file; NULL without a file, and for steps from before schema 0009."""
    depth_file_digest: Mapped[str | None]
    refusal: Mapped[str]
    """Why the depth guard refused the action or ended it early, or an empty string."""


class EventRow(TableBase):
    """An event other than a step: an intervention, a resumption, a warning."""

    __tablename__ = "event"

    id: Mapped[int] = mapped_column(primary_key=True)
    campaign_id: Mapped[int | None] = mapped_column(ForeignKey("campaign.id"), index=True)
    episode_id: Mapped[int | None] = mapped_column(ForeignKey("episode.id"), index=True)
    step_number: Mapped[int | None]
    created_at: Mapped[datetime]
    kind: Mapped[str]
    author: Mapped[str]
    """Author of the event, or an empty string."""
    text: Mapped[str]


class VerdictRow(TableBase):
    """A judgement of an episode or a proposal; append-only, the latest judgement is current."""

    __tablename__ = "verdict"
    __table_args__ = (Index(None, "episode_id", "proposed", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    episode_id: Mapped[int] = mapped_column(ForeignKey("episode.id"))
    created_at: Mapped[datetime]
    proposed: Mapped[bool]
    """The protocol's estimate for a real robot, which an operator confirms or overrules."""
    success: Mapped[bool | None]
    """NULL for a void attempt."""
    end_reason: Mapped[str]
    distance_m: Mapped[float | None]
    distance_source: Mapped[str | None]
    goal_instance: Mapped[str | None]
    goal_in_sight: Mapped[bool | None]
    """As in `episode`."""
    author: Mapped[str]
    """Name of the operator, or `vsnbench`."""
    source: Mapped[str]
    """`protocol` (the judge), `person`, `recovery` or `import`."""
    reason: Mapped[str]
    """The judgement as text."""
    note: Mapped[str]
    """Reason given by the author; may be empty."""
