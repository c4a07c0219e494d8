"""Queries about studies: plan, history and progress.

Those that take an engine raise RecordError if the database cannot be read.
"""

from itertools import pairwise
from statistics import median

from sqlalchemy import Connection, Engine, func, select

from vsnbench.protocol.metrics import known_progress
from vsnbench.results.reading.read_model import STANDS, SUCCESS, current_verdict_id, first_attempt
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.row_encoding import columns_of_fields
from vsnbench.results.schema.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.results.schema.tables import Campaign, Episode, Model, Process, Robot, Session, Site, Trial, Verdict
from vsnbench.results.studies.entries import (
    SESSION,
    SESSION_END,
    RecordedArm,
    RecordedStudy,
    StudyEntryRow,
    StudyTrialProgress,
)
from vsnbench.results.writing.campaigns import CampaignPlan
from vsnbench.results.writing.campaigns import Trial as KnownTrial
from vsnbench.results.writing.lifecycle import RESULTS, EpisodeState
from vsnbench.results.writing.provenance import ProcessIdentity, this_process


def studies(engine: Engine) -> tuple[RecordedStudy, ...]:
    """Return all studies of the record."""
    with transaction(reading(engine)) as connection:
        return tuple(
            read_study(connection, study_id) for study_id in connection.scalars(select(Study.id).order_by(Study.id))
        )


def read_study(connection: Connection, study_id: int) -> RecordedStudy:
    """Return an existing study."""
    study = connection.execute(select(*columns_of_fields(Study, RecordedStudy)).where(Study.id == study_id))
    arms = connection.execute(
        select(
            *(StudyArm.name, StudyArm.code, StudyArm.campaign_id, Campaign.key.label("campaign_key")),
            *(Model.sha256.label("model_sha256"), Model.name.label("model")),
            *(Model.weights_label, Model.weights_sha256, Model.surveyed),
        )
        .join(Campaign, Campaign.id == StudyArm.campaign_id)
        .join(Model, Model.id == Campaign.model_id)
        .where(StudyArm.study_id == study_id)
        .order_by(StudyArm.code)
    )
    entries = connection.execute(
        select(*columns_of_fields(StudyEntry, StudyEntryRow))
        .where(StudyEntry.study_id == study_id)
        .order_by(StudyEntry.created_at, StudyEntry.id)
    )
    return RecordedStudy(
        **study.mappings().one(),
        arms=tuple(RecordedArm(**row) for row in arms.mappings()),
        entries=tuple(StudyEntryRow(**row) for row in entries.mappings()),
    )


def study_progress(
    connection: Connection, study_id: int, process_id: int | None = None
) -> tuple[StudyTrialProgress, ...]:
    """Return the progress of all scheduled trials in the order of the schedule.

    Trials of the process are `here`.
    """
    voids, results = (
        select(func.count())
        .select_from(Episode)
        .where(Episode.trial_id == StudyTrial.trial_id, Episode.state.in_([state.value for state in states]))
        .correlate(StudyTrial)
        .scalar_subquery()
        for states in ((EpisodeState.VOID,), RESULTS)
    )
    rows = connection.execute(
        select(
            *(StudyTrial.rank, StudyTrial.block, StudyArm.name),
            *(Trial.id, Trial.campaign_id, Trial.goal, Trial.start, Trial.repetition),
            *(Episode.id, Episode.state, SUCCESS, Episode.process_id, voids, results),
            *(Episode.started_at, func.coalesce(Session.operator, Process.operator)),
            *(Episode.geodesic_start_m, Episode.geodesic_end_m),
        )
        .select_from(StudyTrial)
        .join(Trial, Trial.id == StudyTrial.trial_id)
        .join(StudyArm, StudyArm.campaign_id == Trial.campaign_id)
        .outerjoin(Episode, Episode.id == first_attempt(StudyTrial.trial_id))
        .outerjoin(Verdict, (Verdict.id == current_verdict_id(Episode.id)) & STANDS)
        .outerjoin(Process, Process.id == Episode.process_id)
        .outerjoin(Session, Session.id == Episode.session_id)
        .where(StudyTrial.study_id == study_id)
        .order_by(StudyTrial.rank)
    )
    return tuple(
        StudyTrialProgress(
            rank=row[0],
            block=row[1],
            arm=row[2],
            trial=KnownTrial(*row[5:8], id=row[3], campaign_id=row[4]),
            episode_id=row[8],
            state=None if row[9] is None else EpisodeState(row[9]),
            success=row[10],
            here=process_id is not None and row[11] == process_id,
            voids=row[12],
            results=row[13],
            started_at=row[14],
            operator=row[15] or "",
            progress=known_progress(row[16], row[17]) if row[9] in RESULTS else None,
        )
        for row in rows
    )


def trials_of(engine: Engine, study_id: int) -> tuple[StudyTrialProgress, ...]:
    """Return the progress of all scheduled trials in the order of the schedule."""
    with transaction(reading(engine)) as connection:
        return study_progress(connection, study_id)


def directories_of(engine: Engine, identity: str) -> tuple[str, ...]:
    """Return the image directories of all episodes of a study, also of void ones."""
    query = (
        select(Episode.images_directory)
        .join(StudyTrial, StudyTrial.trial_id == Episode.trial_id)
        .join(Study, Study.id == StudyTrial.study_id)
        .where(Study.uuid == identity, Episode.images_directory != "")
    )
    with transaction(reading(engine)) as connection:
        return tuple(connection.scalars(query))


def session_of_another(connection: Connection, study_id: int, process_id: int) -> str:
    """Return a description of another live process that runs the study, or an empty string."""
    over = select(StudyEntry.process_id).where(StudyEntry.study_id == study_id, StudyEntry.kind == SESSION_END)
    rows = connection.execute(
        select(Process)
        .with_only_columns(*columns_of_fields(Process, ProcessIdentity), Process.operator, StudyEntry.created_at)
        .join(StudyEntry, StudyEntry.process_id == Process.id)
        .where(
            StudyEntry.study_id == study_id,
            StudyEntry.kind == SESSION,
            StudyEntry.process_id != process_id,
            StudyEntry.process_id.not_in(over),
        )
        .order_by(StudyEntry.id.desc())
    )
    here = this_process()
    for row in rows:
        if ProcessIdentity(*row[:5]).is_alive(here):
            return f"{row.operator} (process {row.pid} on {row.host}, since {row.created_at:%H:%M} UTC)"
    return ""


def trial_duration_s(engine: Engine, robot: str) -> tuple[float, int]:
    """Return the median time between the ends of consecutive episodes of a process, and their number.

    This includes placing and judging. Pauses of more than an hour are ignored.
    """
    query = (
        select(Episode.process_id, Episode.ended_at)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .where(Robot.name == robot, Episode.ended_at.is_not(None), Episode.origin == "run")
        .order_by(Episode.process_id, Episode.ended_at)
    )
    with transaction(reading(engine)) as connection:
        rows = [(process, ended) for process, ended in connection.execute(query) if ended is not None]
    between = [
        (later[1] - earlier[1]).total_seconds()
        for earlier, later in pairwise(rows)
        if earlier[0] == later[0] and (later[1] - earlier[1]).total_seconds() < _PAUSE_S
    ]
    return (median(between), len(between)) if between else (float("nan"), 0)


_PAUSE_S = 3600.0


def blind_study_like(connection: Connection, plan: CampaignPlan) -> str:
    """Return the title of a blinded study with the same site, robot, protocol and seed, whatever the model.

    A refusal that depended on the model would reveal which models are arms of the study.
    """
    found = (
        select(Study.title)
        .join(StudyArm, StudyArm.study_id == Study.id)
        .join(Campaign, Campaign.id == StudyArm.campaign_id)
        .join(Site, Site.id == Campaign.site_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .where(
            *(Study.blind.is_(True), Study.unblinded_at.is_(None), Site.sha256 == plan.site.sha256),
            *(Robot.sha256 == plan.robot.sha256, Campaign.protocol_sha256 == plan.protocol_sha256),
            Campaign.seed == plan.seed,
        )
        .limit(1)
    )
    return connection.execute(found).scalar() or ""


def study_that_claims(engine: Engine, plan: CampaignPlan) -> str:
    """Return why a recorded study reserves a campaign, or an empty string."""
    with transaction(reading(engine)) as connection:
        if title := blind_study_like(connection, plan):
            return (
                f"seed {plan.seed} is that of the blinded study {title!r}, and no model may use it outside of the study"
            )
    title = study_of_campaign(engine, plan.key)
    return f"these trials belong to the locked study {title!r}, which alone may run them" if title else ""


def study_of_campaign(engine: Engine, key: str) -> str:
    """Return the title of the study that has this campaign as an arm, or an empty string."""
    found = (
        select(Study.title)
        .join(StudyArm, StudyArm.study_id == Study.id)
        .join(Campaign, Campaign.id == StudyArm.campaign_id)
        .where(Campaign.key == key)
    )
    with transaction(reading(engine)) as connection:
        return connection.execute(found).scalar() or ""
