"""Carries out a merge within one transaction: campaigns, studies, processes, episodes, verdicts; all or nothing.

Numbers are given anew, in the order in which the episodes began.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, insert, select, update

from vsnbench.database.campaign_plan import extend_plan
from vsnbench.database.episodes import images_directory
from vsnbench.database.merge_plan import (
    IDENTITIES,
    Addition,
    Arrival,
    MergePlan,
    OtherRecord,
    agreeing_campaigns,
    campaign_numbers,
    new_events,
    new_trials,
)
from vsnbench.database.row_encoding import Row, find_or_insert, insert_row, text
from vsnbench.database.study_merging import write_studies
from vsnbench.database.tables import Campaign, Episode, Event, Process, Trial
from vsnbench.database.whole_episodes import (
    add_events,
    add_verdicts,
    columns_of,
    difference,
    insert_whole,
    missing_events,
    read_whole,
)
from vsnbench.errors import RecordError

MERGED = "merged"
"""Kind of the events that say what came from which other record."""

PlaceFiles = Callable[[Arrival, str], None]
"""Puts an arrival's files into a directory, relative to the results directory, before anything is committed."""


_ADVISORY_LOCK = 7_305_514_014


def lock_merges(connection: Connection) -> None:
    """Wait until no other merge writes here; an SQLite file has one writer anyway."""
    if connection.dialect.name == "postgresql":
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_ADVISORY_LOCK})")


def carry_out(
    mine: Connection,
    others: Sequence[OtherRecord],
    plan: MergePlan,
    with_files: Collection[str],
    place_files: PlaceFiles,
) -> None:
    """Write what a plan of these very records says, within one transaction.

    Args:
        mine: a transaction that may write.
        others: as they were when the plan was made.
        plan: what to do.
        with_files: UUIDs of the arrivals whose files come along.
        place_files: called for each of them.

    Raises:
        RecordError: the records contradict each other, or this one was changed since the plan was made.
    """
    processes = _Processes(mine)
    campaigns = agreeing_campaigns(mine, others)
    for row, other in sorted(campaigns.values(), key=lambda found: (found[0]["created_at"], found[0]["key"])):
        _take_campaign(mine, other.connection, row, processes)
    numbers = campaign_numbers(mine)
    for key, trials in new_trials(mine, others, campaigns).items():
        extend_plan(mine, numbers[key], trials)
    for key, events in new_events(mine, others).items():
        mine.execute(insert(Event), [{**event, "campaign_id": numbers[key]} for event in events])
    known = {(row.campaign_id, row.goal, row.start, row.repetition): row.id for row in mine.execute(select(Trial))}
    write_studies(mine, plan.studies.united, numbers, known, processes.number)
    for arrival in plan.arrivals:
        whole = read_whole(others[arrival.other].connection, arrival.number)
        trial = known[numbers[whole.campaign_key], whole.trial.goal, whole.trial.start, whole.trial.repetition]
        has_files = arrival.uuid in with_files
        number = insert_whole(mine, whole, trial, processes.number(whole.process), has_files=has_files)
        if number is None:
            raise RecordError(f"episode {arrival.uuid} came in by another way meanwhile; nothing was written")
        if has_files:
            place_files(arrival, images_directory(number))
    for addition in plan.additions:
        _add(mine, others[addition.other], addition)
    _say_whence(mine, others, plan, numbers)


def _add(mine: Connection, other: OtherRecord, addition: Addition) -> None:
    """Append the verdicts and events that another record has of an episode, and this one lacks."""
    number = mine.execute(select(Episode.id).where(Episode.uuid == addition.uuid)).scalar_one()
    ours = read_whole(mine, number, steps=False)
    theirs = read_whole(other.connection, addition.number, steps=False)
    if wrong := difference(ours, theirs):
        raise RecordError(f"episode {addition.number} of {other.name} ({addition.uuid}): {wrong}; nothing was written")
    add_events(mine, number, missing_events(ours.events, theirs.events))
    if len(theirs.verdicts) > len(ours.verdicts):
        add_verdicts(mine, number, theirs.verdicts[len(ours.verdicts) :])
        mine.execute(update(Episode).where(Episode.id == number).values(state=theirs.state.value))


def _take_campaign(mine: Connection, other: Connection, row: Row, processes: "_Processes") -> None:
    if mine.execute(select(Campaign.id).where(Campaign.key == row["key"])).first() is not None:
        return
    given = {name: value for name, value in row.items() if name != "id"}
    for table, column, _ in IDENTITIES:
        found = other.execute(select(*columns_of(table, "id")).where(table.__table__.c.id == row[column])).mappings()
        given[column] = find_or_insert(mine, table, dict(found.one()), "sha256")
    process = other.execute(select(*columns_of(Process, "id")).where(Process.id == row["process_id"])).mappings()
    given["process_id"] = processes.number(dict(process.one()))
    find_or_insert(mine, Campaign, given, "key")


class _Processes:
    """The processes of this record, found again by what tells them from every other that ever ran."""

    _BY = ("host", "pid", "boot_id", "pid_namespace", "start_ticks", "started_at", "command")

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        rows = connection.execute(select(*columns_of(Process))).mappings()
        self._numbers: dict[tuple[Any, ...], int] = {self._identity(dict(row)): int(row["id"]) for row in rows}

    def number(self, row: Row) -> int:
        """Return the number of a process in this record, which gets it if it lacks it."""
        identity = self._identity(row)
        if identity not in self._numbers:
            self._numbers[identity] = insert_row(self._connection, Process, row)
        return self._numbers[identity]

    def _identity(self, row: Row) -> tuple[Any, ...]:
        return tuple(row[name] for name in self._BY)


def _say_whence(mine: Connection, others: Sequence[OtherRecord], plan: MergePlan, numbers: Mapping[str, int]) -> None:
    """Write down, once a campaign and record, how many episodes came from where."""
    counts: dict[tuple[str, int], int] = {}
    for arrival in plan.arrivals:
        where = (arrival.campaign_key, arrival.other)
        counts[where] = counts.get(where, 0) + 1
    said = {"kind": MERGED, "author": "", "created_at": datetime.now(UTC)}
    for (key, other), count in counts.items():
        words = text(f"{count} episode{'' if count == 1 else 's'} came from {others[other].name}")
        mine.execute(insert(Event), {**said, "campaign_id": numbers[key], "text": words})
