"""What others read of studies: the locked plan with what was done to it, and what has become of its trials."""

from itertools import pairwise
from statistics import median

from sqlalchemy import Connection, Engine, func, select

from vsnbench.database.campaign_plan import Trial as KnownTrial
from vsnbench.database.engine import reading, record_errors
from vsnbench.database.lifecycle import RESULTS, EpisodeState
from vsnbench.database.provenance import ProcessIdentity, this_process
from vsnbench.database.read_model import STANDS, SUCCESS, standing_verdict_id
from vsnbench.database.study_entries import (
    SESSION,
    SESSION_END,
    RecordedArm,
    RecordedStudy,
    StudyEntryRow,
    StudyTrialStanding,
)
from vsnbench.database.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.database.tables import Campaign, Episode, Model, Process, Robot, Session, Trial, Verdict


def find_study(engine: Engine, identity: str) -> RecordedStudy | None:
    """Return the study of this identity; None where the record has no such.

    Raises:
        RecordError: the database cannot be read.
    """
    with record_errors(engine), reading(engine).begin() as connection:
        number = connection.execute(select(Study.id).where(Study.uuid == identity)).scalar()
        return None if number is None else read_study(connection, number)


def studies(engine: Engine) -> tuple[RecordedStudy, ...]:
    """Return every study of the record.

    Raises:
        RecordError: the database cannot be read.
    """
    with record_errors(engine), reading(engine).begin() as connection:
        return tuple(read_study(connection, each) for each in connection.scalars(select(Study.id).order_by(Study.id)))


def read_study(connection: Connection, study_id: int) -> RecordedStudy:
    """Return a study that is there."""
    row = connection.execute(select(Study.__table__).where(Study.id == study_id)).one()
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
        select(
            StudyEntry.created_at,
            StudyEntry.kind,
            StudyEntry.author,
            StudyEntry.reason,
            StudyEntry.text,
            StudyEntry.results,
            StudyEntry.process_id,
        )
        .where(StudyEntry.study_id == study_id)
        .order_by(StudyEntry.created_at, StudyEntry.id)
    )
    return RecordedStudy(
        id=row.id,
        uuid=row.uuid,
        title=row.title,
        content=row.content,
        sha256=row.sha256,
        locked_sha256=row.locked_sha256,
        schedule_sha256=row.schedule_sha256,
        blind=row.blind,
        locked_at=row.locked_at,
        unblinded_at=row.unblinded_at,
        arms=tuple(RecordedArm(**one) for one in arms.mappings()),
        entries=tuple(StudyEntryRow(**one) for one in entries.mappings()),
    )


def study_standing(
    connection: Connection, study_id: int, process_id: int | None = None
) -> tuple[StudyTrialStanding, ...]:
    """Say what has become of every scheduled trial, in the order of the schedule.

    Args:
        connection: a transaction that reads.
        study_id: the study's number.
        process_id: whose trials are `here`; nobody's when None.
    """
    first = (
        select(func.min(Episode.id))
        .where(Episode.trial_id == StudyTrial.trial_id, Episode.state != EpisodeState.VOID.value)
        .correlate(StudyTrial)
        .scalar_subquery()
    )
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
        )
        .select_from(StudyTrial)
        .join(Trial, Trial.id == StudyTrial.trial_id)
        .join(StudyArm, StudyArm.campaign_id == Trial.campaign_id)
        .outerjoin(Episode, Episode.id == first)
        .outerjoin(Verdict, (Verdict.id == standing_verdict_id(Episode.id)) & STANDS)
        .outerjoin(Process, Process.id == Episode.process_id)
        .outerjoin(Session, Session.id == Episode.session_id)
        .where(StudyTrial.study_id == study_id)
        .order_by(StudyTrial.rank)
    )
    return tuple(
        StudyTrialStanding(
            rank=row[0],
            block=row[1],
            arm=row[2],
            trial=KnownTrial(*row[3:8]),
            episode_id=row[8],
            state=None if row[9] is None else EpisodeState(row[9]),
            success=row[10],
            here=process_id is not None and row[11] == process_id,
            voids=row[12],
            results=row[13],
            started_at=row[14],
            operator=row[15] or "",
        )
        for row in rows
    )


def trials_of(engine: Engine, study_id: int) -> tuple[StudyTrialStanding, ...]:
    """Say what has become of every scheduled trial, in the order of the schedule.

    Raises:
        RecordError: the database cannot be read.
    """
    with record_errors(engine), reading(engine).begin() as connection:
        return study_standing(connection, study_id)


def directories_of(engine: Engine, identity: str) -> tuple[str, ...]:
    """Return where the files of every episode of a study lie, void ones too; relative to the results directory.

    Raises:
        RecordError: the database cannot be read.
    """
    query = (
        select(Episode.images_directory)
        .join(StudyTrial, StudyTrial.trial_id == Episode.trial_id)
        .join(Study, Study.id == StudyTrial.study_id)
        .where(Study.uuid == identity, Episode.images_directory != "")
    )
    with record_errors(engine), reading(engine).begin() as connection:
        return tuple(connection.scalars(query))


def session_of_another(connection: Connection, study_id: int, process_id: int) -> str:
    """Name another living process that runs the study, with its operator; empty for none."""
    over = select(StudyEntry.process_id).where(StudyEntry.study_id == study_id, StudyEntry.kind == SESSION_END)
    rows = connection.execute(
        select(Process)
        .with_only_columns(
            *(Process.host, Process.pid, Process.boot_id, Process.pid_namespace, Process.start_ticks),
            *(Process.operator, StudyEntry.created_at),
        )
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


def pace_s(engine: Engine, robot: str) -> tuple[float, int]:
    """Return the median time from one episode's end to the next one's in one process, and of how many.

    What a trial takes with placing, thinking and judging; pauses of more than an hour are none.

    Args:
        engine: the record.
        robot: name of the robot's profile.

    Raises:
        RecordError: the database cannot be read.
    """
    query = (
        select(Episode.process_id, Episode.ended_at)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .where(Robot.name == robot, Episode.ended_at.is_not(None), Episode.origin == "run")
        .order_by(Episode.process_id, Episode.ended_at)
    )
    with record_errors(engine), reading(engine).begin() as connection:
        rows = [(process, ended) for process, ended in connection.execute(query) if ended is not None]
    between = [
        (later[1] - one[1]).total_seconds()
        for one, later in pairwise(rows)
        if one[0] == later[0] and (later[1] - one[1]).total_seconds() < _PAUSE_S
    ]
    return (median(between), len(between)) if between else (float("nan"), 0)


_PAUSE_S = 3600.0


def study_of_campaign(engine: Engine, key: str) -> str:
    """Return the title of the study that the campaign of this key is an arm of; empty for none.

    Raises:
        RecordError: the database cannot be read.
    """
    found = (
        select(Study.title)
        .join(StudyArm, StudyArm.study_id == Study.id)
        .join(Campaign, Campaign.id == StudyArm.campaign_id)
        .where(Campaign.key == key)
    )
    with record_errors(engine), reading(engine).begin() as connection:
        return connection.execute(found).scalar() or ""
