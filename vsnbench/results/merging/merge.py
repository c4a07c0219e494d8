"""Applies a merge within one transaction: campaigns, studies, processes, episodes and verdicts; all or nothing.

Numbers are assigned anew, in the order in which the episodes began.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from sqlalchemy import Connection, insert, select, update

from vsnbench.errors import RecordError
from vsnbench.results.merging.episodes import (
    OtherRecord,
    add_rows,
    columns_of,
    difference,
    insert_episode_rows,
    missing_events,
    read_episode_rows,
)
from vsnbench.results.merging.goals import take_definitions
from vsnbench.results.merging.plan import IDENTITIES, MergePlan, OtherEpisode, campaign_numbers
from vsnbench.results.merging.studies import write_studies
from vsnbench.results.schema.row_encoding import Row, event_row, find_or_insert, insert_row
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, EventRow, ProcessRow, TrialRow, VerdictRow
from vsnbench.results.writing.campaigns import extend_plan
from vsnbench.results.writing.episodes import PlaceFiles, images_directory
from vsnbench.text.sanitize import counted

MERGED = "merged"
"""Kind of events that record the source of merged episodes."""

_ADVISORY_LOCK = 7_305_514_014


def lock_merges(connection: Connection) -> None:
    """Wait until no other merge writes to this record; SQLite has a single writer anyway."""
    if connection.dialect.name == "postgresql":
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_ADVISORY_LOCK})")


def apply_merge(
    mine: Connection,
    others: Sequence[OtherRecord],
    plan: MergePlan,
    with_files: Collection[str],
    place_files: PlaceFiles,
) -> None:
    """Apply a merge plan within the transaction in which it was made.

    `with_files` are the UUIDs of the new episodes whose files are added; `place_files` is called for each of them.

    Raises:
        RecordError: the records contradict each other, or this one has changed since the plan was made.
    """
    processes = _Processes(mine)
    for row, other in sorted(plan.new_campaigns.values(), key=lambda found: (found[0]["created_at"], found[0]["key"])):
        _take_campaign(mine, other.connection, row, processes)
    numbers = campaign_numbers(mine)
    for key, trials in plan.new_trials.items():
        goals = take_definitions(mine, key, [trial.goal for trial in trials], plan.definitions)
        extend_plan(mine, numbers[key], trials, goals)
    for key, events in plan.new_events.items():
        mine.execute(insert(EventRow), [{**event, "campaign_id": numbers[key]} for event in events])
    known = {(row.campaign_id, row.goal, row.start, row.repetition): row.id for row in mine.execute(select(TrialRow))}
    write_studies(mine, plan.studies.united, numbers, known, processes.number)
    for new_episode in plan.new_episodes:
        whole = read_episode_rows(others[new_episode.other].connection, new_episode.number)
        trial = known[numbers[whole.campaign_key], whole.trial.goal, whole.trial.start, whole.trial.repetition]
        has_files = new_episode.uuid in with_files
        number = insert_episode_rows(mine, whole, trial, processes.number(whole.process), has_files=has_files)
        if number is None:
            raise RecordError(f"episode {new_episode.uuid} was added by another process; nothing was written")
        if has_files:
            place_files(new_episode.uuid, images_directory(number))
    for known_episode in plan.updates:
        _add(mine, others[known_episode.other], known_episode)
    _record_sources(mine, others, plan, numbers)


def _add(mine: Connection, other: OtherRecord, episode: OtherEpisode) -> None:
    """Append the verdicts and events of an episode that this record lacks."""
    number = mine.execute(select(EpisodeRow.id).where(EpisodeRow.uuid == episode.uuid)).scalar_one()
    ours = read_episode_rows(mine, number, steps=False)
    theirs = read_episode_rows(other.connection, episode.number, steps=False)
    if wrong := difference(ours, theirs):
        raise RecordError(f"episode {episode.number} of {other.name} ({episode.uuid}): {wrong}; nothing was written")
    add_rows(mine, EventRow, number, missing_events(ours.events, theirs.events))
    if len(theirs.verdicts) > len(ours.verdicts):
        add_rows(mine, VerdictRow, number, theirs.verdicts[len(ours.verdicts) :])
        mine.execute(update(EpisodeRow).where(EpisodeRow.id == number).values(state=theirs.episode["state"]))


def _take_campaign(mine: Connection, other: Connection, row: Row, processes: "_Processes") -> None:
    given = {name: value for name, value in row.items() if name != "id"}
    for table, column, _ in IDENTITIES:
        found = other.execute(select(*columns_of(table, "id")).where(table.__table__.c.id == row[column])).mappings()
        given[column] = find_or_insert(mine, table, dict(found.one()), "sha256")
    process = other.execute(select(*columns_of(ProcessRow, "id")).where(ProcessRow.id == row["process_id"])).mappings()
    given["process_id"] = processes.number(dict(process.one()))
    insert_row(mine, CampaignRow, given)


class _Processes:
    """Processes of this record, found by their identity."""

    _BY = ("host", "pid", "boot_id", "pid_namespace", "start_ticks", "started_at", "command")

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        rows = connection.execute(select(*columns_of(ProcessRow))).mappings()
        self._numbers: dict[tuple[Any, ...], int] = {self._identity(dict(row)): int(row["id"]) for row in rows}

    def number(self, row: Row) -> int:
        """Return the number of a process in this record, inserting it if needed."""
        identity = self._identity(row)
        if identity not in self._numbers:
            self._numbers[identity] = insert_row(self._connection, ProcessRow, row)
        return self._numbers[identity]

    def _identity(self, row: Row) -> tuple[Any, ...]:
        return tuple(row[name] for name in self._BY)


def _record_sources(
    mine: Connection, others: Sequence[OtherRecord], plan: MergePlan, numbers: Mapping[str, int]
) -> None:
    """Record, per campaign and source, the number of merged episodes."""
    counts = Counter((episode.campaign_key, episode.other) for episode in plan.new_episodes)
    for (key, other), count in counts.items():
        words = f"{counted(count, 'episode')} came from {others[other].name}"
        mine.execute(insert(EventRow), event_row(MERGED, words, campaign_id=numbers[key]))
