"""Reads the recorded data of a locked study for comparison with its lock and log."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Engine, select

from vsnbench.protocol.scheduled_trial import ScheduledTrial
from vsnbench.results.goals import with_goals
from vsnbench.results.reading.episode_numbers import missing_numbers
from vsnbench.results.reading.identities import RowFault, identity_faults
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.results.schema.tables import Campaign, Episode, Model, Robot, Site, Trial
from vsnbench.results.studies.log import LogEvent, events_of, measured_by_episode, verdicts_by_episode
from vsnbench.results.studies.writing import logged_entry
from vsnbench.results.writing.lifecycle import ENDED


@dataclass(frozen=True, slots=True)
class EndedEpisode:
    """An ended episode of a study as stored."""

    number: int
    arm: str
    goal: str
    start: int
    repetition: int
    state: str
    verdicts: tuple[Mapping[str, Any], ...]
    measured: Mapping[str, Any]
    """What was measured, in the format of the log."""


@dataclass(frozen=True, slots=True)
class StudyEvidence:
    """Recorded data of a study."""

    seed: int
    heads: frozenset[str]
    log: tuple[LogEvent, ...]
    entries: tuple[Mapping[str, Any], ...]
    """Rows of `study_entry` in the format of the log."""
    schedule: tuple[ScheduledTrial, ...]
    episodes: Mapping[str, EndedEpisode]
    """UUID -> ended episode."""
    missing_numbers: tuple[int, ...]
    """Episode numbers of the whole record that have no row and were not released."""
    site_content: Mapping[str, Any]
    identity_faults: tuple[str, ...]
    """Rows of the arms' campaigns, models, robot and site whose content does not have their hash."""


def read_evidence(engine: Engine, study_id: int) -> StudyEvidence:
    """Read the recorded data of a study.

    Raises:
        RecordError: the database cannot be read.
    """
    with transaction(reading(engine)) as connection:
        study = connection.execute(select(Study.seed, Study.log_heads).where(Study.id == study_id)).one()
        entries = connection.execute(select(StudyEntry.__table__).where(StudyEntry.study_id == study_id)).mappings()
        return StudyEvidence(
            seed=study.seed,
            heads=frozenset(study.log_heads.split()),
            log=events_of(connection, study_id),
            entries=tuple(logged_entry(dict(row)) for row in entries),
            schedule=_schedule(connection, study_id),
            episodes=_episodes(connection, study_id),
            missing_numbers=missing_numbers(connection),
            site_content=_site_content(connection, study_id),
            identity_faults=tuple(_identity_faults(connection, study_id)),
        )


def _schedule(connection: Connection, study_id: int) -> tuple[ScheduledTrial, ...]:
    rows = connection.execute(
        select(StudyTrial.rank, StudyTrial.block, StudyArm.name, Trial.goal, Trial.start, Trial.repetition)
        .join(Trial, Trial.id == StudyTrial.trial_id)
        .outerjoin(StudyArm, (StudyArm.campaign_id == Trial.campaign_id) & (StudyArm.study_id == StudyTrial.study_id))
        .where(StudyTrial.study_id == study_id)
        .order_by(StudyTrial.rank)
    )
    return tuple(ScheduledTrial(row[0], row[1], row[2] or "", *row[3:]) for row in rows)


def _episodes(connection: Connection, study_id: int) -> Mapping[str, EndedEpisode]:
    ended = (
        select(
            *(Episode.uuid, Episode.id, Episode.state),
            *(StudyArm.name, Trial.goal, Trial.start, Trial.repetition),
        )
        .select_from(Episode)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(StudyArm, StudyArm.campaign_id == Trial.campaign_id)
        .where(StudyArm.study_id == study_id, Episode.state.in_([state.value for state in ENDED]))
    )
    rows = connection.execute(ended).all()
    numbers = select(ended.subquery().c.id)
    verdicts, measured = verdicts_by_episode(connection, numbers), measured_by_episode(connection, numbers)
    return {
        row.uuid: EndedEpisode(
            number=row.id,
            arm=row.name,
            goal=row.goal,
            start=row.start,
            repetition=row.repetition,
            state=row.state,
            verdicts=tuple(verdicts.get(row.id, ())),
            measured=measured.get(row.id, {}),
        )
        for row in rows
    }


def _site_content(connection: Connection, study_id: int) -> Mapping[str, Any]:
    found = connection.execute(
        select(Site.content, Campaign.id)
        .join(Campaign, Campaign.site_id == Site.id)
        .join(StudyArm, StudyArm.campaign_id == Campaign.id)
        .where(StudyArm.study_id == study_id)
        .order_by(StudyArm.code)
    ).all()
    return with_goals(connection, found[0][0], [campaign for _, campaign in found]) if found else {}


def _identity_faults(connection: Connection, study_id: int) -> Iterator[str]:
    campaigns = select(StudyArm.campaign_id).where(StudyArm.study_id == study_id)
    for table, column in (
        *((Campaign, Campaign.id), (Site, Campaign.site_id)),
        *((Robot, Campaign.robot_id), (Model, Campaign.model_id)),
    ):
        numbers = select(column).where(Campaign.id.in_(campaigns))
        for fault in identity_faults(connection, table, numbers):
            if isinstance(fault, RowFault):
                yield f"{fault.table} {fault.row}: {fault.column} {fault.text}"
