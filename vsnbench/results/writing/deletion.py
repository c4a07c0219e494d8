"""Deletes episodes and campaigns for good; what is deleted is first set aside in a directory of its own."""

from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, delete, insert, select

from vsnbench.errors import RecordError, UsageError
from vsnbench.results.database_url import sqlite_path
from vsnbench.results.files.directory import DATABASE_NAME, ResultsDirectory
from vsnbench.results.schema.backup import backup
from vsnbench.results.schema.engine import opened_engine, transaction
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.schema.row_encoding import event_row, parts
from vsnbench.results.schema.study_tables import StudyArm
from vsnbench.results.schema.tables import Campaign, Episode, Event, Step, Trial, Verdict
from vsnbench.results.writing.lifecycle import ACTIVE

DELETED = "deleted"
"""Kind of events that say what was deleted, by whom and why."""
_SET_ASIDE = "deleted"


@dataclass(frozen=True, slots=True)
class Deletion:
    """Rows to delete: episodes, and campaigns with all of theirs."""

    episodes: tuple[int, ...]
    """All of them, those of `campaigns` included."""
    campaigns: tuple[int, ...]
    images_directories: tuple[str, ...]


def plan_deletion(connection: Connection, episodes: Collection[int], campaigns: Collection[int]) -> Deletion:
    """Check what may be deleted.

    Raises:
        UsageError: something does not exist, belongs to a study, or runs.
    """
    for kind, table, numbers in (("episode", Episode, episodes), ("campaign", Campaign, campaigns)):
        known = set(connection.scalars(select(table.id).where(table.id.in_(list(numbers)))))
        if missing := sorted(set(numbers) - known):
            raise UsageError(f"{kind} {missing[0]} does not exist", advice="nothing was deleted")
    rows = connection.execute(
        select(Episode.id, Episode.state, Episode.images_directory, StudyArm.study_id)
        .join(Trial, Trial.id == Episode.trial_id)
        .outerjoin(StudyArm, StudyArm.campaign_id == Trial.campaign_id)
        .where(Episode.id.in_(list(episodes)) | Trial.campaign_id.in_(list(campaigns)))
        .order_by(Episode.id)
    ).all()
    in_study = select(StudyArm.study_id).where(StudyArm.campaign_id.in_(list(campaigns)))
    if any(row.study_id is not None for row in rows) or connection.scalar(in_study) is not None:
        raise UsageError(
            "the data of a locked study cannot be deleted",
            advice="nothing was deleted; `vsnbench judge N --void WHY` takes an episode out of the results",
            code="locked-study",
        )
    if running := [row.id for row in rows if row.state in {state.value for state in ACTIVE}]:
        raise UsageError(f"episode {running[0]} is running", advice="nothing was deleted; stop its run first")
    return Deletion(
        tuple(row.id for row in rows),
        tuple(campaigns),
        tuple(row.images_directory for row in rows if row.images_directory),
    )


def delete_for_good(
    results: ResultsDirectory, episodes: Collection[int], campaigns: Collection[int], *, author: str, reason: str
) -> tuple[Deletion, Path]:
    """Back the record up, delete the rows in one transaction, and move their files next to the backup.

    Returns:
        What was deleted, and the directory with the backup and the files.

    Raises:
        UsageError: something may not be deleted; nothing was.
        RecordError: the backup or the record cannot be written.
    """
    aside = results.path / _SET_ASIDE / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S}"
    with opened_engine(results.database_url) as engine:
        with transaction(engine) as connection:
            plan_deletion(connection, episodes, campaigns)
        try:
            aside.mkdir(parents=True)
        except OSError as error:
            why = error.strerror or error
            raise RecordError(f"cannot create {aside}: {why}", advice="nothing was deleted") from error
        is_file = sqlite_path(results.database_url) is not None
        backup(results.database_url, aside / (DATABASE_NAME if is_file else "vsnbench.dump"))
        with transaction(engine) as connection:
            plan = plan_deletion(connection, episodes, campaigns)
            _delete(connection, plan, author=author, reason=reason)
    # After the commit: a crash in between leaves files without rows, never rows without files.
    for name in plan.images_directories:
        source = results.episode_directory(name)
        if source.is_dir() and not source.is_symlink():
            (aside / name).parent.mkdir(parents=True, exist_ok=True)
            source.rename(aside / name)
    return plan, aside


def _delete(connection: Connection, plan: Deletion, *, author: str, reason: str) -> None:
    what = _named(connection, Campaign.id, Campaign.key, "campaign", plan.campaigns)
    what += _named(connection, Episode.id, Episode.uuid, "episode", plan.episodes)
    for some in parts(plan.episodes):
        for column in (Step.episode_id, Verdict.episode_id, Placement.episode_id, Event.episode_id, Episode.id):
            connection.execute(delete(column.class_).where(column.in_(some)))
    if plan.campaigns:
        for column in (Event.campaign_id, Trial.campaign_id, Campaign.id):
            connection.execute(delete(column.class_).where(column.in_(plan.campaigns)))
    if what:
        connection.execute(insert(Event), [event_row(DELETED, f"{line}: {reason}", author=author) for line in what])


def _named(connection: Connection, number: Any, identity: Any, kind: str, numbers: Collection[int]) -> list[str]:
    found = []
    for some in parts(numbers):
        query = select(number, identity).where(number.in_(some)).order_by(number)
        found += [f"{kind} {row[0]} ({row[1]})" for row in connection.execute(query)]
    return found
