"""An episode that was run where this record is not: its steps, events and end become rows in one transaction."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Connection, insert, select, update

from vsnbench.database.episode_entries import EpisodeBegin, EpisodeEnd
from vsnbench.database.episodes import end_episode
from vsnbench.database.provenance import Provenance
from vsnbench.database.row_encoding import insert_row, process_row, text
from vsnbench.database.step_rows import step_row
from vsnbench.database.tables import Episode, Event, Process, Step
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.step_record import StepRecord


@dataclass(frozen=True, slots=True)
class SealedEvent:
    """Something that happened beside the steps."""

    kind: str
    text: str
    author: str
    step_number: int | None
    created_at: datetime


@dataclass(frozen=True, slots=True)
class SealedRows:
    """What the record keeps of one episode, beside its files; plain values."""

    ran_on: Provenance
    """The worker's process."""
    placed: Fix | None
    """Where the robot stood at the start; None where it could not even begin."""
    begun: EpisodeBegin | None
    steps: Sequence[StepRecord]
    events: Sequence[SealedEvent]
    end: EpisodeEnd


def keep_sealed(connection: Connection, process_id: int, episode_id: int, sealed: SealedRows) -> None:
    """Write what happened in an episode of this process within a transaction; see `Journal.keep_sealed`."""
    if sealed.steps:
        connection.execute(insert(Step), [step_row(episode_id, step) for step in sealed.steps])
    if sealed.events:
        connection.execute(
            insert(Event),
            [
                {
                    "kind": event.kind,
                    "author": text(event.author),
                    "text": text(event.text),
                    "created_at": event.created_at,
                    "campaign_id": None,
                    "episode_id": episode_id,
                    "step_number": event.step_number,
                }
                for event in sealed.events
            ],
        )
    end_episode(connection, process_id, episode_id, sealed.end)
    ran_on = _process_of(connection, sealed.ran_on)
    connection.execute(update(Episode).where(Episode.id == episode_id).values(process_id=ran_on))


def _process_of(connection: Connection, ran_on: Provenance) -> int:
    """Return the row of a worker's process, which it shares with every episode that it ran."""
    who = ran_on.identity
    known = connection.execute(
        select(Process.id).where(
            Process.host == text(who.host),
            Process.pid == who.pid,
            Process.boot_id == who.boot_id,
            Process.pid_namespace == who.pid_namespace,
            Process.start_ticks == who.start_ticks,
            Process.started_at == ran_on.started_at,
        )
    ).scalar()
    return known if known is not None else insert_row(connection, Process, process_row(ran_on))
