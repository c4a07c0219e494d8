"""Writes an episode that was run by a remote worker: steps, events and end in one transaction."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime

from sqlalchemy import Connection, insert, select, update

from vsnbench.results.schema.row_encoding import columns_of_fields, insert_row, process_row, text
from vsnbench.results.schema.tables import EpisodeRow, EventRow, ProcessRow, StepRow
from vsnbench.results.studies.log import log_outcome
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.episodes import write_end
from vsnbench.results.writing.provenance import ProcessIdentity, Provenance
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
        connection.execute(insert(StepRow), [step_row(episode_id, step) for step in sealed.steps])
    if sealed.events:
        connection.execute(
            insert(EventRow),
            [
                {**asdict(event), "author": text(event.author), "text": text(event.text), "episode_id": episode_id}
                for event in sealed.events
            ],
        )
    write_end(connection, process_id, episode_id, sealed.end)
    ran_on = _process_of(connection, sealed.ran_on)
    connection.execute(update(EpisodeRow).where(EpisodeRow.id == episode_id).values(process_id=ran_on))
    log_outcome(connection, episode_id)  # with the operator of the process that ran it


def _process_of(connection: Connection, ran_on: Provenance) -> int:
    """Return the row of a worker's process, shared by all its episodes."""
    row = process_row(ran_on)
    columns = [*columns_of_fields(ProcessRow, ProcessIdentity), ProcessRow.started_at]
    known = connection.scalar(select(ProcessRow.id).where(*(column == row[column.name] for column in columns)))
    return insert_row(connection, ProcessRow, row) if known is None else known
