"""Deletes episodes and campaigns for good; what is deleted is first set aside in a directory of its own.

A list in that directory names what is being deleted. It is there from before the rows go until the files are moved, so
that the next program can finish what a killed one, or one with a full disk, has begun.
"""

import errno
import fcntl
import json
import logging
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, delete, insert, select

from vsnbench.errors import RecordError, UsageError, VsnbenchError
from vsnbench.files.atomic import PART, sweep_parts, write_atomic
from vsnbench.files.bounded_json import parse_json
from vsnbench.results.database_url import redacted_url, sqlite_path
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.results.files.directory import DATABASE_NAME, ResultsDirectory
from vsnbench.results.schema.backup import backup
from vsnbench.results.schema.engine import opened_engine, transaction
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.schema.row_encoding import event_row, parts
from vsnbench.results.schema.study_tables import StudyArm
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, EventRow, StepRow, TrialRow, VerdictRow
from vsnbench.results.writing.episodes import images_directory
from vsnbench.results.writing.lifecycle import ACTIVE

DELETED = "deleted"
"""Kind of events that say what was deleted, by whom and why."""
_SET_ASIDE = "deleted"
_UNFINISHED = "unfinished.json"
"""Name of the list, in the directory with the backup."""
_UNFINISHED_DELETION = "unfinished-deletion"

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Deletion:
    """Rows to delete: episodes, and campaigns with all of theirs."""

    episodes: tuple[int, ...]
    """All of them, those of `campaigns` included."""
    campaigns: tuple[int, ...]
    uuids: tuple[str, ...]
    """Of the episodes; as many."""
    images_directories: tuple[str, ...]


def plan_deletion(connection: Connection, episodes: Collection[int], campaigns: Collection[int]) -> Deletion:
    """Check what may be deleted.

    Raises:
        UsageError: something does not exist, belongs to a study, or runs.
        RecordError: an episode names files that are not its own.
    """
    for kind, table, numbers in (("episode", EpisodeRow, episodes), ("campaign", CampaignRow, campaigns)):
        known = set(connection.scalars(select(table.id).where(table.id.in_(list(numbers)))))
        if missing := sorted(set(numbers) - known):
            raise UsageError(f"{kind} {missing[0]} does not exist", advice="nothing was deleted")
    rows = connection.execute(
        select(EpisodeRow.id, EpisodeRow.uuid, EpisodeRow.state, EpisodeRow.images_directory, StudyArm.study_id)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .outerjoin(StudyArm, StudyArm.campaign_id == TrialRow.campaign_id)
        .where(EpisodeRow.id.in_(list(episodes)) | TrialRow.campaign_id.in_(list(campaigns)))
        .order_by(EpisodeRow.id)
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
    if foreign := [row for row in rows if row.images_directory not in ("", images_directory(row.id))]:
        raise RecordError(
            f"episode {foreign[0].id} names {foreign[0].images_directory[:200]!r} as the directory of its images, "
            f"which is not its own: the record was not written by vsnbench",
            advice="nothing was deleted",
            code="foreign-images",
        )
    return Deletion(
        tuple(row.id for row in rows),
        tuple(campaigns),
        tuple(row.uuid for row in rows),
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
        RecordError: the backup or the record cannot be written; or the files cannot be moved (`unfinished-deletion`).
    """
    confined(results.path, "episodes")
    aside = results.path / _SET_ASIDE / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S}"
    with opened_engine(results.database_url) as engine:
        with transaction(engine) as connection:
            plan = plan_deletion(connection, episodes, campaigns)
        try:
            aside.mkdir(parents=True)
        except OSError as error:
            why = error.strerror or error
            raise RecordError(f"cannot create {aside}: {why}", advice="nothing was deleted") from error
        with _held(aside):
            try:
                _list_unfinished(results, aside, plan)
                backup(results.database_url, aside / _backup_name(results))
                with transaction(engine) as connection:
                    plan = plan_deletion(connection, episodes, campaigns)
                    _list_unfinished(results, aside, plan)
                    _delete(connection, plan, author=author, reason=reason)
            except VsnbenchError:
                with suppress(VsnbenchError):
                    _finish(results, aside, plan)
                raise
            _move_files(results, aside, plan.images_directories)
    return plan, aside


def finish_deletions(results: ResultsDirectory, *, required: bool = False) -> list[tuple[Deletion, Path]]:
    """Finish the deletions that other programs began and did not finish; return them as `delete_for_good` does.

    If its rows are still there, a deletion did not happen, and its backup is removed. Deletions of running programs,
    those from another database and those in a directory that this process cannot write to or lock stay.

    Args:
        results: the record.
        required: raise an error instead of a warning if the files cannot be moved.

    Raises:
        RecordError: the record cannot be read, or files cannot be moved (`unfinished-deletion`).
    """
    finished = []
    for aside in _unfinished(results.path):
        if not os.access(aside, os.W_OK):
            continue
        with ExitStack() as stack:
            try:
                stack.enter_context(_held(aside))
            except OSError:
                continue
            plan = _listed(aside, _database(results))
            try:
                if plan is not None and _finish(results, aside, plan):
                    logger.warning("an interrupted `vsnbench db delete` was finished; backup and images: %s", aside)
                    finished.append((plan, aside))
            except RecordError as error:
                if required or error.code != _UNFINISHED_DELETION:
                    raise
                logger.warning("an interrupted `vsnbench db delete`: %s", error.statement)
    return finished


def unfinished_directories(results: Path) -> set[str]:
    """Return the directories of episodes whose deletion was not finished, relative to the results directory."""
    plans = [_listed(aside) for aside in _unfinished(results)]
    return {directory for plan in plans if plan is not None for directory in plan.images_directories}


def _unfinished(results: Path) -> list[Path]:
    return sorted(file.parent for file in (results / _SET_ASIDE).glob(f"*/{_UNFINISHED}"))


def _database(results: ResultsDirectory) -> str:
    """Return which database a list belongs to: the path relative to the results directory, or the URL."""
    if (file := sqlite_path(results.database_url)) is None:
        return redacted_url(results.database_url)
    return os.path.relpath(file.resolve(), results.path.resolve())


def _listed(aside: Path, database: str | None = None) -> Deletion | None:
    """Return the deletion that a list describes; None without a valid list of `_list_unfinished`.

    Args:
        aside: the directory of the list.
        database: None is also returned if the list belongs to another one; `_database` of the record.
    """
    try:
        content = parse_json(read_confined(aside, _UNFINISHED) or b"")
        if content.pop("database") != database and database is not None:
            return None
        plan = Deletion(**{name: tuple(values) for name, values in content.items()})
        own = {images_directory(episode) for episode in plan.episodes}
        if set(plan.images_directories) <= own and all(isinstance(text, str) for text in plan.uuids):
            return plan
    except (RecordError, ValueError, TypeError, AttributeError, KeyError, RecursionError):
        pass
    logger.warning("%s is not a list of deleted episodes", aside / _UNFINISHED)
    return None


@contextmanager
def _held(aside: Path) -> Iterator[None]:
    """Lock the directory of a deletion.

    Raises:
        BlockingIOError: another process is deleting.
        OSError: the directory is gone, or its file system has no locks.
    """
    held = os.open(aside, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(held)


def _list_unfinished(results: ResultsDirectory, aside: Path, plan: Deletion) -> None:
    """Write the list, on the disk before the rows go."""
    write_atomic(aside / _UNFINISHED, json.dumps({"database": _database(results), **asdict(plan)}).encode())
    for path in (aside / _UNFINISHED, aside):
        opened = os.open(path, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)


def _finish(results: ResultsDirectory, aside: Path, plan: Deletion) -> bool:
    """Move the files of a deletion whose rows are gone, or remove what was written for another; return which."""
    with opened_engine(results.database_url, read_only=True) as engine, transaction(engine) as connection:
        rows = connection.execute(select(EpisodeRow.uuid, EpisodeRow.images_directory))
        recorded = {row.uuid: row.images_directory for row in rows}
        campaigns = set(connection.scalars(select(CampaignRow.id)))
    if not recorded.keys().isdisjoint(plan.uuids) or (not plan.uuids and not campaigns.isdisjoint(plan.campaigns)):
        with suppress(OSError):
            if (aside / "episodes").exists():  # it did happen, and the record was restored
                (aside / _UNFINISHED).unlink()
                return False
            (aside / _backup_name(results)).unlink(missing_ok=True)
            sweep_parts(aside)
            (aside / _UNFINISHED).unlink()
            aside.rmdir()
        return False
    # After a restore, a later episode can have the number of a deleted one.
    _move_files(results, aside, sorted(set(plan.images_directories) - set(recorded.values())))
    return True


def _move_files(results: ResultsDirectory, aside: Path, directories: Collection[str]) -> None:
    # After the commit: a crash in between leaves files without rows, never rows without files.
    confined(results.path, "episodes")
    try:
        for name in directories:
            _move(results.path / name, aside / name)
        (aside / _UNFINISHED).unlink()
    except OSError as error:
        raise RecordError(
            f"the rows are deleted, but {error.filename or results.path} cannot be moved: {error.strerror or error}",
            advice="repeat the command; the next run tries again as well",
            code=_UNFINISHED_DELETION,
        ) from error


def _move(source: Path, target: Path) -> None:
    """Move a directory, also to another disk and after an interrupted attempt; a link is moved, not followed."""
    if not os.path.lexists(source):
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        source.rename(target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        if source.is_symlink():
            target.symlink_to(source.readlink())
            source.unlink()
            return
        if not target.exists():
            part = target.with_name(f"{target.name}{PART}")
            if part.exists():
                shutil.rmtree(part)
            shutil.copytree(source, part, symlinks=True)
            os.sync()
            part.rename(target)
        shutil.rmtree(source)


def _backup_name(results: ResultsDirectory) -> str:
    return DATABASE_NAME if sqlite_path(results.database_url) is not None else "vsnbench.dump"


def _delete(connection: Connection, plan: Deletion, *, author: str, reason: str) -> None:
    what = _named(connection, CampaignRow.id, CampaignRow.key, "campaign", plan.campaigns)
    what += _named(connection, EpisodeRow.id, EpisodeRow.uuid, "episode", plan.episodes)
    for some in parts(plan.episodes):
        for column in (
            StepRow.episode_id,
            VerdictRow.episode_id,
            Placement.episode_id,
            EventRow.episode_id,
            EpisodeRow.id,
        ):
            connection.execute(delete(column.class_).where(column.in_(some)))
    if plan.campaigns:
        for column in (EventRow.campaign_id, TrialRow.campaign_id, CampaignRow.id):
            connection.execute(delete(column.class_).where(column.in_(plan.campaigns)))
    if what:
        connection.execute(insert(EventRow), [event_row(DELETED, f"{line}: {reason}", author=author) for line in what])


def _named(connection: Connection, number: Any, identity: Any, kind: str, numbers: Collection[int]) -> list[str]:
    found = []
    for some in parts(numbers):
        query = select(number, identity).where(number.in_(some)).order_by(number)
        found += [f"{kind} {row[0]} ({row[1]})" for row in connection.execute(query)]
    return found
