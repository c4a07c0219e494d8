"""Finds episodes and sessions of dead processes and closes them.

Running episodes become `interrupted` and keep their steps; claims are released.
"""

import textwrap
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, Engine, Row, Select, func, insert, inspect, select, update

from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.row_encoding import columns_of_fields, event_row, verdict_row
from vsnbench.results.schema.tables import EpisodeRow, EventRow, ProcessRow, SessionRow, StepRow, TrialRow, VerdictRow
from vsnbench.results.writing.entries import RecoveredEpisode
from vsnbench.results.writing.episodes import NOT_STARTED, release
from vsnbench.results.writing.lifecycle import ACTIVE, LEASE, EpisodeState, moment
from vsnbench.results.writing.provenance import ProcessIdentity, this_process
from vsnbench.results.writing.steps import THINKING_S
from vsnbench.text.sanitize import sanitize


def orphaned_episodes(connection: Connection, here: ProcessIdentity) -> list[Row[*tuple[Any, ...]]]:
    """Return the open episodes whose process is dead, as far as the process `here` can tell."""
    rows = connection.execute(_open_episodes()).all()
    now = moment(connection) if rows else None
    return [row for row in rows if now is not None and _is_dead(row, here, connection.dialect.name, now)]


def lost_episodes(engine: Engine) -> frozenset[int]:
    """Return the numbers of the open episodes whose process is dead; the next writer closes them.

    Raises:
        RecordError: the database cannot be read.
    """
    with transaction(reading(engine)) as connection:
        return frozenset(row.id for row in orphaned_episodes(connection, this_process()))


def orphaned_sessions(connection: Connection, here: ProcessIdentity) -> list[int]:
    """Return the numbers of open sessions whose process is known to be dead."""
    rows = connection.execute(
        select(SessionRow.id, *_IDENTITY)
        .join(ProcessRow, ProcessRow.id == SessionRow.process_id)
        .where(SessionRow.ended_at.is_(None))
    )
    return [row.id for row in rows if _is_running(row, here, connection.dialect.name) is False]


def live_writers(connection: Connection, here: ProcessIdentity) -> str:
    """Return a description of another live process that writes to the record, or an empty string.

    For a process that cannot be checked from here, the lease of its episode decides. Works with any schema.
    """
    dialect = connection.dialect.name
    unknown = set()
    for row in connection.execute(select(ProcessRow.id, ProcessRow.command, *_IDENTITY).order_by(ProcessRow.id.desc())):
        alive = _is_running(row, here, dialect)
        if alive and row.pid != here.pid:
            command = textwrap.shorten(sanitize(row.command), 60, placeholder=" …")
            return f"process {row.pid} on {sanitize(row.host)} ({command})"
        if alive is None:
            unknown.add(row.id)
    if not unknown or "lease_until" not in {column["name"] for column in inspect(connection).get_columns("episode")}:
        return ""
    held = select(EpisodeRow.id, EpisodeRow.process_id).where(
        EpisodeRow.state.in_([state.value for state in ACTIVE]), EpisodeRow.lease_until > moment(connection)
    )
    return next((f"episode {row.id}" for row in connection.execute(held) if row.process_id in unknown), "")


def recover_one(connection: Connection, row: Row[*tuple[Any, ...]]) -> RecoveredEpisode | None:
    """Close one of `orphaned_episodes`; None for a claim, or if another process has closed it."""
    if row.state in NOT_STARTED:
        release(connection, row.id)
        return None
    ended_at = row.last_step_at or row.started_at
    closed = connection.execute(
        update(EpisodeRow)
        .where(EpisodeRow.id == row.id, EpisodeRow.state == EpisodeState.RUNNING.value)
        .values(
            state=EpisodeState.VOID.value,
            lease_until=None,
            ended_at=ended_at,
            end_reason=EndReason.INTERRUPTED.value,
            error=f"process {row.pid} on {row.host} died",
            actions=row.steps,
            path_length_m=row.path_length_m,
            duration_s=row.duration_s,
            thinking_s=THINKING_S,
            wall_duration_s=(ended_at - row.started_at).total_seconds(),
        ),
        {"episode": row.id},
    )
    if closed.rowcount != 1:
        return None
    void = Verdict(EndReason.INTERRUPTED, None, "void: the process died; the trial must be repeated")
    connection.execute(insert(VerdictRow), verdict_row(row.id, void, author="vsnbench", source="recovery"))
    words = f"process {row.pid} on {row.host} died after {row.steps} recorded steps"
    connection.execute(insert(EventRow), event_row("recovered", words, episode_id=row.id, campaign_id=row.campaign_id))
    return RecoveredEpisode(row.id, row.steps, row.images_directory)


def interrupted(connection: Connection) -> tuple[RecoveredEpisode, ...]:
    """Return the episodes that ended because their process died."""
    rows = connection.execute(
        select(EpisodeRow.id, EpisodeRow.actions, EpisodeRow.images_directory).where(
            EpisodeRow.end_reason == EndReason.INTERRUPTED.value, EpisodeRow.images_directory != ""
        )
    )
    return tuple(RecoveredEpisode(*row) for row in rows)


_IDENTITY = columns_of_fields(ProcessRow, ProcessIdentity)


def _open_episodes() -> Select[*tuple[Any, ...]]:
    active = [state.value for state in ACTIVE]
    steps = (
        select(
            func.count().label("steps"),
            func.max(StepRow.recorded_at, type_=StepRow.recorded_at.type).label("last_step_at"),
            func.sum(func.abs(StepRow.displacement_m)).label("path_length_m"),
            func.sum(StepRow.duration_s).label("duration_s"),
            StepRow.episode_id,
        )
        .join(EpisodeRow, EpisodeRow.id == StepRow.episode_id)
        .where(EpisodeRow.state.in_(active))
        .group_by(StepRow.episode_id)
        .subquery()
    )
    return (
        select(
            EpisodeRow.id,
            EpisodeRow.state,
            EpisodeRow.started_at,
            EpisodeRow.lease_until,
            EpisodeRow.images_directory,
            TrialRow.campaign_id,
            *_IDENTITY,
            func.coalesce(steps.c.steps, 0).label("steps"),
            steps.c.last_step_at,
            steps.c.path_length_m,
            steps.c.duration_s,
        )
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .join(ProcessRow, ProcessRow.id == EpisodeRow.process_id)
        .outerjoin(steps, steps.c.episode_id == EpisodeRow.id)
        .where(EpisodeRow.state.in_(active))
        .order_by(EpisodeRow.id)
    )


def _is_dead(running: Row[*tuple[Any, ...]], here: ProcessIdentity, dialect: str, now: datetime) -> bool:
    alive = _is_running(running, here, dialect)
    if alive is not None:
        return not alive
    until: datetime = running.lease_until or (running.last_step_at or running.started_at) + LEASE
    return now > until


def _is_running(row: Row[*tuple[Any, ...]], here: ProcessIdentity, dialect: str) -> bool | None:
    """Return whether a row's process is alive; None if unknown."""
    identity = ProcessIdentity(row.host, row.pid, row.boot_id, row.pid_namespace, row.start_ticks)
    alive = identity.is_alive(here)
    # An SQLite file is local: a process of another kernel no longer exists.
    return False if alive is None and dialect == "sqlite" and identity.boot_id != here.boot_id else alive
