"""Closes what dead processes left running: such an episode is `interrupted`, and its committed steps stay."""

from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Connection, Row, Select, func, insert, select, update

from vsnbench.database.provenance import ProcessIdentity
from vsnbench.database.records import RecoveredEpisode
from vsnbench.database.rows import verdict_row
from vsnbench.database.tables import Episode, Event, Process, Step, Trial
from vsnbench.database.tables import Verdict as VerdictTable
from vsnbench.protocol.judge import EndReason, Verdict

SILENCE_LIMIT = timedelta(minutes=15)
"""A process that cannot be asked whether it lives (another machine or container) counts as dead after this."""


def dead_episodes(connection: Connection, here: ProcessIdentity) -> list[Row[*tuple[Any, ...]]]:
    """Return the running episodes whose process does not live, as far as the process `here` can know."""
    return [row for row in connection.execute(_running()) if _is_dead(row, here, connection.dialect.name)]


def interrupt(connection: Connection, row: Row[*tuple[Any, ...]]) -> RecoveredEpisode:
    """Close one of `dead_episodes` with what its steps tell."""
    ended_at = row.last_step_at or row.started_at
    connection.execute(
        update(Episode)
        .where(Episode.id == row.id, Episode.end_reason.is_(None))
        .values(
            ended_at=ended_at,
            end_reason=EndReason.INTERRUPTED.value,
            error=f"process {row.pid} on {row.host} died",
            actions=row.steps,
            path_length_m=row.path_length_m,
            duration_s=row.duration_s,
            wall_duration_s=(ended_at - row.started_at).total_seconds(),
        )
    )
    void = Verdict(EndReason.INTERRUPTED, None, "void: the process died; the trial must be run again")
    connection.execute(insert(VerdictTable), verdict_row(row.id, void, author="vsnbench", source="recovery"))
    connection.execute(
        insert(Event),
        {
            "episode_id": row.id,
            "campaign_id": row.campaign_id,
            "created_at": datetime.now(UTC),
            "kind": "recovered",
            "text": f"process {row.pid} on {row.host} died after {row.steps} recorded steps",
        },
    )
    return RecoveredEpisode(row.id, row.goal, row.start, row.steps, row.images_directory)


def _running() -> Select[*tuple[Any, ...]]:
    steps = (
        select(
            func.count().label("steps"),
            func.max(Step.recorded_at, type_=Step.recorded_at.type).label("last_step_at"),
            func.sum(func.abs(Step.displacement_m)).label("path_length_m"),
            func.sum(Step.duration_s).label("duration_s"),
            Step.episode_id,
        )
        .join(Episode, Episode.id == Step.episode_id)
        .where(Episode.end_reason.is_(None))
        .group_by(Step.episode_id)
        .subquery()
    )
    return (
        select(
            Episode.id,
            Episode.started_at,
            Episode.images_directory,
            Trial.campaign_id,
            Trial.goal,
            Trial.start,
            Process.host,
            Process.pid,
            Process.boot_id,
            Process.pid_namespace,
            Process.start_ticks,
            func.coalesce(steps.c.steps, 0).label("steps"),
            steps.c.last_step_at,
            steps.c.path_length_m,
            steps.c.duration_s,
        )
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Process, Process.id == Episode.process_id)
        .outerjoin(steps, steps.c.episode_id == Episode.id)
        .where(Episode.end_reason.is_(None))
        .order_by(Episode.id)
    )


def _is_dead(running: Row[*tuple[Any, ...]], here: ProcessIdentity, dialect: str) -> bool:
    identity = ProcessIdentity(running.host, running.pid, running.boot_id, running.pid_namespace, running.start_ticks)
    alive = identity.is_alive(here)
    if alive is not None:
        return not alive
    # An SQLite file lies on a disk of this machine: who wrote to it under another kernel is gone.
    if dialect == "sqlite" and identity.boot_id != here.boot_id:
        return True
    silence: timedelta = datetime.now(UTC) - (running.last_step_at or running.started_at)
    return silence > SILENCE_LIMIT
