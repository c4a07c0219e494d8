"""Merges studies: equal locks are one study, with the union of their histories.

Two studies are the same if the file, the schedule with its codes and the arms are equal. Their schedule is shared;
amendments, unblindings and sessions are united. A merge never counts trials that were run outside of the plan, and
never chooses between two plans.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from typing import Any

from sqlalchemy import Connection, func, insert, select, update

from vsnbench.errors import RecordError
from vsnbench.results.merging.episodes import OtherRecord, columns_of
from vsnbench.results.schema.row_encoding import Row, insert_row
from vsnbench.results.schema.study_tables import Study, StudyArm, StudyEntry, StudyEvent, StudyTrial
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, ProcessRow, TrialRow
from vsnbench.results.studies.entries import AMEND
from vsnbench.results.studies.log import LogEvent, events_of
from vsnbench.text.sanitize import sanitize

ScheduledCell = tuple[int, int, str, str, int, int]
"""Rank, block, key of the campaign, goal, starting position, repetition."""


@dataclass(frozen=True, slots=True)
class StudyChangeRows:
    """An entry of a study's history with its process."""

    entry: Row
    process: Row


@dataclass(frozen=True, slots=True)
class StudyRows:
    """A study as plain rows, without record-specific numbers."""

    record: str
    """Display name of its record."""
    study: Row
    process: Row
    arms: tuple[tuple[str, str, str], ...]
    """Name, code and campaign key, ordered by code."""
    schedule: tuple[ScheduledCell, ...]
    history: tuple[StudyChangeRows, ...]
    log: tuple[LogEvent, ...]

    @property
    def identity(self) -> tuple[Any, ...]:
        """Everything that was locked."""
        return self.study["locked_sha256"], self.study["schedule_sha256"], self.arms

    @property
    def title(self) -> str:
        """Display title."""
        return repr(sanitize(self.study["title"]))

    @property
    def amendments(self) -> tuple[StudyChangeRows, ...]:
        """Amendments, oldest first."""
        return tuple(entry for entry in self.history if entry.entry["kind"] == AMEND)

    @property
    def is_blind(self) -> bool:
        """Whether the study is blinded in its record."""
        return bool(self.study["blind"]) and self.study["unblinded_at"] is None


@dataclass(slots=True)
class StudiesPlan:
    """Effects of a merge on the studies."""

    united: list[StudyRows] = field(default_factory=list)
    """Final state of every study that is new here or has new history."""
    new: int = 0
    """Number of new studies."""
    entries: int = 0
    """Number of new history entries."""
    revealed: list[StudyRows] = field(default_factory=list)
    """Studies that are blinded in one record and unblinded in another, and therefore become unblinded."""


def plan_studies(records: Sequence[OtherRecord]) -> StudiesPlan:
    """Unite the studies of the records and return the effects on the first.

    Raises:
        RecordError: they contradict each other, or trials of a study were run outside of it.
    """
    studies = [_read_studies(record) for record in records]
    here = {study.identity: study for study in studies[0]}
    known = dict(here)
    for study in chain(*studies[1:]):
        known[study.identity] = _united(known[study.identity], study) if study.identity in known else study
    blind = {study.identity for study in chain(*studies) if study.is_blind}
    _check_campaigns(known.values(), records)
    plan = StudiesPlan()
    for identity, study in known.items():
        if study == here.get(identity):
            continue
        plan.united.append(study)
        plan.new += identity not in here
        plan.entries += len(study.history) - (len(here[identity].history) if identity in here else 0)
        if identity in blind and not study.is_blind:
            plan.revealed.append(study)
    return plan


def _read_studies(record: OtherRecord) -> list[StudyRows]:
    """Return the studies of a record; their plans must match their hashes."""
    rows = record.connection.execute(select(*columns_of(Study)).order_by(Study.id)).mappings()
    found = [_read(record.name, record.connection, dict(row)) for row in rows.all()]
    for read in found:
        if hashlib.sha256(read.study["content"].encode()).hexdigest() != read.study["sha256"]:
            raise RecordError(
                f"the plan of the study {read.title} in {record.name} was edited by hand after the lock",
                advice="nothing was written; restore it there from a backup",
            )
    return found


def _read(record: str, connection: Connection, study: Row) -> StudyRows:
    number, process = study.pop("id"), study.pop("process_id")
    arms = connection.execute(
        select(StudyArm.name, StudyArm.code, CampaignRow.key)
        .join(CampaignRow, CampaignRow.id == StudyArm.campaign_id)
        .where(StudyArm.study_id == number)
        .order_by(StudyArm.code)
    )
    schedule = connection.execute(
        select(StudyTrial.rank, StudyTrial.block, CampaignRow.key, TrialRow.goal, TrialRow.start, TrialRow.repetition)
        .join(TrialRow, TrialRow.id == StudyTrial.trial_id)
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .where(StudyTrial.study_id == number)
        .order_by(StudyTrial.rank)
    )
    processes = {
        row.pop("id"): row for row in map(dict, connection.execute(select(*columns_of(ProcessRow))).mappings())
    }
    entries = connection.execute(
        select(*columns_of(StudyEntry, "id", "study_id"))
        .where(StudyEntry.study_id == number)
        .order_by(StudyEntry.created_at, StudyEntry.id)
    ).mappings()
    history = [StudyChangeRows(row, processes[row.pop("process_id")]) for row in map(dict, entries)]
    return StudyRows(
        record,
        study,
        processes[process],
        tuple(tuple(row) for row in arms),  # type: ignore[misc]
        tuple(tuple(row) for row in schedule),  # type: ignore[misc]
        tuple(history),
        events_of(connection, number),
    )


def _united(first: StudyRows, second: StudyRows) -> StudyRows:
    """Return the union of two equal studies, with the plan that was amended last."""
    if first.schedule != second.schedule:
        raise RecordError(
            f"the schedule of the study {second.title} in {second.record} differs from that of the same hash in "
            f"{first.record}",
            advice="nothing was written; one of the records was edited by hand",
        )
    ours, theirs = first.amendments, second.amendments
    shared = min(len(ours), len(theirs))
    if first.study["sha256"] != second.study["sha256"] and ours[:shared] != theirs[:shared]:
        raise RecordError(
            f"the study {first.title} has different amendments in {first.record} and {second.record}",
            advice="nothing was written; amend one of them until both files are equal, then merge again",
        )
    plan = second if len(theirs) > len(ours) else first
    unblinded = [study.study["unblinded_at"] for study in (first, second) if study.study["unblinded_at"] is not None]
    history = [*first.history, *(entry for entry in second.history if entry not in first.history)]
    log = {event.sha256: event for event in (*second.log, *first.log)}
    followed = {parent for event in log.values() for parent in event.parents}
    # A head without its event is kept: the merged record reports it as missing too.
    heads = {*first.study["log_heads"].split(), *second.study["log_heads"].split()} - followed
    return replace(
        first,
        study={
            **first.study,
            **{name: plan.study[name] for name in ("content", "sha256", "title")},
            "locked_at": min(first.study["locked_at"], second.study["locked_at"]),
            "unblinded_at": min(unblinded, default=None),
            "log_heads": " ".join(sorted(heads)),
        },
        history=tuple(sorted(history, key=lambda change: change.entry["created_at"])),
        log=tuple(sorted(log.values(), key=lambda event: event.created_at)),
    )


def _check_campaigns(studies: Iterable[StudyRows], records: Sequence[OtherRecord]) -> None:
    """Check that every trial of a study was run as part of that study."""
    owners: dict[str, StudyRows] = {}
    for study in studies:
        for _, code, key in study.arms:
            other = owners.setdefault(key, study)
            if other is not study:
                raise RecordError(
                    f"arm {code} of the study {study.title} in {study.record} is an arm of the study {other.title} in "
                    f"{other.record} as well: its trials would count in both",
                    advice="nothing was written; keep these records apart",
                )
    for record in records:
        arms = select(CampaignRow.key).join(StudyArm, StudyArm.campaign_id == CampaignRow.id)
        locked = set(record.connection.scalars(arms))
        for key, count in _episodes(record.connection).items():
            if key in owners and key not in locked:
                code = next(code for _, code, arm in owners[key].arms if arm == key)
                raise RecordError(
                    f"{record.name} has {count} episodes of arm {code} of the study {owners[key].title} that were run "
                    f"outside of it; the study is locked in {owners[key].record}",
                    advice="nothing was written; keep these records apart",
                )


def _episodes(connection: Connection) -> Mapping[str, int]:
    rows = connection.execute(
        select(CampaignRow.key, func.count())
        .select_from(EpisodeRow)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .group_by(CampaignRow.key)
    )
    return {row[0]: row[1] for row in rows}


def write_studies(
    mine: Connection,
    studies: Iterable[StudyRows],
    campaigns: Mapping[str, int],
    trials: Mapping[tuple[int, str, int, int], int],
    process: Callable[[Row], int],
) -> None:
    """Write united studies within a transaction that already contains their campaigns and trials.

    `campaigns` and `trials` are numbers in this record; `process` returns the number of a process.
    """
    here = {study.identity: study for study in _read_studies(OtherRecord("this record", mine))}
    for study in studies:
        there = here.get(study.identity)
        if there is None:
            number = insert_row(mine, Study, {**study.study, "process_id": process(study.process)})
            arms = [
                {"study_id": number, "campaign_id": campaigns[key], "name": name, "code": code}
                for name, code, key in study.arms
            ]
            mine.execute(insert(StudyArm), arms)
            schedule = [
                {"study_id": number, "trial_id": trials[campaigns[key], goal, start, nth], "rank": rank, "block": block}
                for rank, block, key, goal, start, nth in study.schedule
            ]
            mine.execute(insert(StudyTrial), schedule)
        else:
            number = mine.execute(select(Study.id).where(Study.uuid == there.study["uuid"])).scalar_one()
            mine.execute(update(Study).where(Study.id == number).values(study.study))
        fresh = [done for done in study.history if there is None or done not in there.history]
        if fresh:
            rows = [{**done.entry, "study_id": number, "process_id": process(done.process)} for done in fresh]
            mine.execute(insert(StudyEntry), rows)
        known = {event.sha256 for event in there.log} if there is not None else set()
        events = [{**asdict(event), "study_id": number} for event in study.log if event.sha256 not in known]
        if events:
            mine.execute(insert(StudyEvent), events)
