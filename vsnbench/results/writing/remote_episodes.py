"""Writes an episode that was run by a remote worker: steps, events and end in one transaction."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Connection, insert, select, update

from vsnbench.results.schema.row_encoding import insert_row, process_row, text
from vsnbench.results.schema.tables import Episode, Event, Process, Step
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.episodes import end_episode
from vsnbench.results.writing.provenance import Provenance
from vsnbench.results.writing.steps import step_row
from vsnbench.values.fix import Fix
from vsnbench.values.step import StepRecord


@dataclass(frozen=True, slots=True)
class BundledEvent:
    """An event of a remote episode."""

    kind: str
    text: str
    author: str
    step_number: int | None
    created_at: datetime


@dataclass(frozen=True, slots=True)
class BundledRows:
    """Recorded data of a remote episode, except its files; serializable."""

    ran_on: Provenance
    """Description of the worker's process."""
    placed: Fix | None
    """Start pose; None if the episode could not begin."""
    begun: EpisodeBegin | None
    steps: Sequence[StepRecord]
    events: Sequence[BundledEvent]
    end: EpisodeEnd


def store_bundle(connection: Connection, process_id: int, episode_id: int, sealed: BundledRows) -> None:
    """Write the data of an episode of this process within a transaction; see `Journal.store_bundle`."""
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
    """Return the row of a worker's process, shared by all its episodes."""
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
