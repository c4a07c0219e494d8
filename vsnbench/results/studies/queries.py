"""Queries about studies: plan, history and progress.

Those that take an engine raise RecordError if the database cannot be read.
"""

from itertools import pairwise
from statistics import median

from sqlalchemy import Connection, Engine, func, select

from vsnbench.protocol.metrics import known_progress
from vsnbench.results.reading.read_model import (
    COUNTS,
    STANDS,
    SUCCESS,
    current_verdict_id,
    episodes_of_campaigns,
    first_attempt,
)
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.row_encoding import columns_of_fields
from vsnbench.results.schema.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.results.schema.tables import (
    CampaignRow,
    EpisodeRow,
    ModelRow,
    ProcessRow,
    RobotRow,
    SessionRow,
    SiteRow,
    TrialRow,
    VerdictRow,
)
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
            *(StudyArm.name, StudyArm.code, StudyArm.campaign_id, CampaignRow.key.label("campaign_key")),
            *(ModelRow.sha256.label("model_sha256"), ModelRow.name.label("model")),
            *(ModelRow.weights_label, ModelRow.weights_sha256, ModelRow.surveyed),
        )
        .join(CampaignRow, CampaignRow.id == StudyArm.campaign_id)
        .join(ModelRow, ModelRow.id == CampaignRow.model_id)
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
        .select_from(EpisodeRow)
        .where(EpisodeRow.trial_id == StudyTrial.trial_id, EpisodeRow.state.in_([state.value for state in states]))
        .correlate(StudyTrial)
        .scalar_subquery()
        for states in ((EpisodeState.VOID,), RESULTS)
    )
    rows = connection.execute(
        select(
            *(StudyTrial.rank, StudyTrial.block, StudyArm.name),
            *(TrialRow.id, TrialRow.campaign_id, TrialRow.goal, TrialRow.start, TrialRow.repetition),
            *(EpisodeRow.id, EpisodeRow.state, SUCCESS, EpisodeRow.process_id, voids, results),
            *(EpisodeRow.started_at, func.coalesce(SessionRow.operator, ProcessRow.operator)),
            *(EpisodeRow.geodesic_start_m, EpisodeRow.geodesic_end_m),
        )
        .select_from(StudyTrial)
        .join(TrialRow, TrialRow.id == StudyTrial.trial_id)
        .join(StudyArm, StudyArm.campaign_id == TrialRow.campaign_id)
        .outerjoin(EpisodeRow, EpisodeRow.id == first_attempt(StudyTrial.trial_id))
        .outerjoin(VerdictRow, (VerdictRow.id == current_verdict_id(EpisodeRow.id)) & STANDS)
        .outerjoin(ProcessRow, ProcessRow.id == EpisodeRow.process_id)
        .outerjoin(SessionRow, SessionRow.id == EpisodeRow.session_id)
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


def twin_rates(engine: Engine, study: RecordedStudy, arm: str) -> dict[tuple[str, int], float]:
    """Return the simulated success rates of an arm's model by goal and starting position, for a planned twin.

    They are of the same model, site and protocol, outside of the study. An episode that ended after the first real
    trial of the study began does not count: a twin that is run later could be chosen by the real outcomes.
    """
    campaign = study.by_name[arm].campaign_id
    same = select(CampaignRow.model_id, CampaignRow.site_id, CampaignRow.protocol_sha256).where(
        CampaignRow.id == campaign
    )
    began = (
        select(func.min(EpisodeRow.started_at))
        .join(StudyTrial, StudyTrial.trial_id == EpisodeRow.trial_id)
        .where(StudyTrial.study_id == study.id)
    )
    found: dict[tuple[str, int], list[bool]] = {}
    with transaction(reading(engine)) as connection:
        model, site, protocol = connection.execute(same).one()
        first = connection.execute(began).scalar()
        query = episodes_of_campaigns(TrialRow.goal, TrialRow.start, SUCCESS).where(
            *(COUNTS, RobotRow.simulated.is_(True), EpisodeRow.origin == "run"),
            *(CampaignRow.model_id == model, CampaignRow.site_id == site, CampaignRow.protocol_sha256 == protocol),
            CampaignRow.id.not_in(select(StudyArm.campaign_id)),
        )
        if first is not None:
            query = query.where(EpisodeRow.ended_at < first)
        for goal, start, success in connection.execute(query):
            found.setdefault((goal, start), []).append(bool(success))
    return {place: sum(outcomes) / len(outcomes) for place, outcomes in found.items()}


def directories_of(engine: Engine, identity: str) -> tuple[str, ...]:
    """Return the image directories of all episodes of a study, also of void ones."""
    query = (
        select(EpisodeRow.images_directory)
        .join(StudyTrial, StudyTrial.trial_id == EpisodeRow.trial_id)
        .join(Study, Study.id == StudyTrial.study_id)
        .where(Study.uuid == identity, EpisodeRow.images_directory != "")
    )
    with transaction(reading(engine)) as connection:
        return tuple(connection.scalars(query))


def session_of_another(connection: Connection, study_id: int, process_id: int) -> str:
    """Return a description of another live process that runs the study, or an empty string."""
    over = select(StudyEntry.process_id).where(StudyEntry.study_id == study_id, StudyEntry.kind == SESSION_END)
    rows = connection.execute(
        select(ProcessRow)
        .with_only_columns(*columns_of_fields(ProcessRow, ProcessIdentity), ProcessRow.operator, StudyEntry.created_at)
        .join(StudyEntry, StudyEntry.process_id == ProcessRow.id)
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
        select(EpisodeRow.process_id, EpisodeRow.ended_at)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .join(RobotRow, RobotRow.id == CampaignRow.robot_id)
        .where(RobotRow.name == robot, EpisodeRow.ended_at.is_not(None), EpisodeRow.origin == "run")
        .order_by(EpisodeRow.process_id, EpisodeRow.ended_at)
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
        .join(CampaignRow, CampaignRow.id == StudyArm.campaign_id)
        .join(SiteRow, SiteRow.id == CampaignRow.site_id)
        .join(RobotRow, RobotRow.id == CampaignRow.robot_id)
        .where(
            *(Study.blind.is_(True), Study.unblinded_at.is_(None), SiteRow.sha256 == plan.site.sha256),
            *(RobotRow.sha256 == plan.robot.sha256, CampaignRow.protocol_sha256 == plan.protocol_sha256),
            CampaignRow.seed == plan.seed,
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
        .join(CampaignRow, CampaignRow.id == StudyArm.campaign_id)
        .where(CampaignRow.key == key)
    )
    with transaction(reading(engine)) as connection:
        return connection.execute(found).scalar() or ""
