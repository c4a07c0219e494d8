"""The studies of several records as one: the same where the same was locked, with all that was done to them anywhere.

Two records hold one study where the file, the schedule with its codes and the arms that were locked are equal, whoever
locked it where. Of its schedule there is one; of its amendments, unblindings and sessions every one is kept. What no
merge may do is to count trials that were run outside of the plan, or to choose between two plans.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Connection, func, insert, select, update

from vsnbench.database.row_encoding import Row, insert_row
from vsnbench.database.study_entries import AMEND
from vsnbench.database.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.database.tables import Campaign, Episode, Process, Trial
from vsnbench.database.whole_episodes import columns_of
from vsnbench.errors import RecordError
from vsnbench.harmless_text import harmless

ScheduledCell = tuple[int, int, str, str, int, int]
"""Rank, block, key of the campaign, goal, starting position, repetition."""


@dataclass(frozen=True, slots=True)
class DoneToStudy:
    """An entry of a study's history, and the process that made it."""

    entry: Row
    process: Row

    @property
    def moment(self) -> Any:
        """When."""
        return self.entry["created_at"]


@dataclass(frozen=True, slots=True)
class WholeStudy:
    """A study as another record can take it: rows of plain values, without the numbers of the record they are in."""

    record: str
    """Which one it is from, for people."""
    study: Row
    process: Row
    arms: tuple[tuple[str, str, str], ...]
    """Name, code, and key of the campaign; in the order of the codes."""
    schedule: tuple[ScheduledCell, ...]
    history: tuple[DoneToStudy, ...]

    @property
    def identity(self) -> tuple[Any, ...]:
        """What makes it this study: everything that was locked."""
        return self.study["locked_sha256"], self.study["schedule_sha256"], self.arms

    @property
    def title(self) -> str:
        """For people."""
        return repr(harmless(self.study["title"]))

    @property
    def amendments(self) -> tuple[DoneToStudy, ...]:
        """Its amendments, the first one first."""
        return tuple(one for one in self.history if one.entry["kind"] == AMEND)

    @property
    def is_blind(self) -> bool:
        """Whether people see codes there."""
        return bool(self.study["blind"]) and self.study["unblinded_at"] is None


@dataclass(slots=True)
class StudiesPlan:
    """What a merge would do to the studies."""

    united: list[WholeStudy] = field(default_factory=list)
    """Every study that is new here, or of which another record knows more, as it will be."""
    new: int = 0
    """How many of them are new here."""
    entries: int = 0
    """Entries of their history that come in."""
    revealed: list[WholeStudy] = field(default_factory=list)
    """Those that are blind in one record and were unblinded in another, and so are blind no more."""


def plan_studies(mine: Connection, others: Sequence[tuple[str, Connection]]) -> StudiesPlan:
    """Unite the studies of the records, and say what that changes in this one.

    Args:
        mine: this record.
        others: those that come into it, with their names.

    Raises:
        RecordError: they contradict each other, or trials of a study were run outside of it.
    """
    here = {one.identity: one for one in whole_studies("this record", mine)}
    known, blind = dict(here), {identity for identity, one in here.items() if one.is_blind}
    for name, connection in others:
        for one in whole_studies(name, connection):
            known[one.identity] = _united(known[one.identity], one) if one.identity in known else one
            blind |= {one.identity} if one.is_blind else set()
    _check_campaigns(known.values(), [("this record", mine), *others])
    plan = StudiesPlan()
    for identity, one in known.items():
        if one == here.get(identity):
            continue
        plan.united.append(one)
        plan.new += identity not in here
        plan.entries += len(one.history) - (len(here[identity].history) if identity in here else 0)
        if identity in blind and not one.is_blind:
            plan.revealed.append(one)
    return plan


def whole_studies(record: str, connection: Connection) -> tuple[WholeStudy, ...]:
    """Return the studies of a record.

    Raises:
        RecordError: what one of them says of its own plan is not true.
    """
    found = []
    for study in connection.execute(select(*columns_of(Study)).order_by(Study.id)).mappings():
        one = _read(record, connection, dict(study))
        if hashlib.sha256(one.study["content"].encode()).hexdigest() != one.study["sha256"]:
            raise RecordError(
                f"the plan of the study {one.title} in {record} was changed by hand after it was locked",
                advice="nothing was written; restore it there from a backup",
            )
        found.append(one)
    return tuple(found)


def _read(record: str, connection: Connection, study: Row) -> WholeStudy:
    number, process = study.pop("id"), study.pop("process_id")
    arms = connection.execute(
        select(StudyArm.name, StudyArm.code, Campaign.key)
        .join(Campaign, Campaign.id == StudyArm.campaign_id)
        .where(StudyArm.study_id == number)
        .order_by(StudyArm.code)
    )
    schedule = connection.execute(
        select(StudyTrial.rank, StudyTrial.block, Campaign.key, Trial.goal, Trial.start, Trial.repetition)
        .join(Trial, Trial.id == StudyTrial.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .where(StudyTrial.study_id == number)
        .order_by(StudyTrial.rank)
    )
    processes = {row["id"]: dict(row) for row in connection.execute(select(*columns_of(Process))).mappings()}
    for row in processes.values():
        del row["id"]
    entries = connection.execute(
        select(*columns_of(StudyEntry, "id", "study_id"))
        .where(StudyEntry.study_id == number)
        .order_by(StudyEntry.created_at, StudyEntry.id)
    ).mappings()
    history = [DoneToStudy(dict(row), processes[row["process_id"]]) for row in entries]
    for one in history:
        del one.entry["process_id"]
    return WholeStudy(
        record,
        study,
        processes[process],
        tuple(tuple(row) for row in arms),  # type: ignore[misc]
        tuple(tuple(row) for row in schedule),  # type: ignore[misc]
        tuple(history),
    )


def _united(first: WholeStudy, second: WholeStudy) -> WholeStudy:
    """Return one study of two that are the same, by the plan of the one that was amended last."""
    if first.schedule != second.schedule:
        raise RecordError(
            f"the schedule of the study {second.title} in {second.record} is not that of the same hash in "
            f"{first.record}",
            advice="nothing was written; one of them was changed by hand",
        )
    ours, theirs = first.amendments, second.amendments
    shared = min(len(ours), len(theirs))
    if first.study["sha256"] != second.study["sha256"] and ours[:shared] != theirs[:shared]:
        raise RecordError(
            f"the study {first.title} was amended one way in {first.record} and another way in {second.record}",
            advice="nothing was written; amend one of them until its file is the other's, and merge again",
        )
    plan = second if len(theirs) > len(ours) else first
    unblinded = [one.study["unblinded_at"] for one in (first, second) if one.study["unblinded_at"] is not None]
    told = [*first.history, *(one for one in second.history if one not in first.history)]
    return replace(
        first,
        study={
            **first.study,
            **{name: plan.study[name] for name in ("content", "sha256", "title")},
            "locked_at": min(first.study["locked_at"], second.study["locked_at"]),
            "unblinded_at": min(unblinded, default=None),
        },
        history=tuple(sorted(told, key=lambda one: one.moment)),
    )


def _check_campaigns(studies: Iterable[WholeStudy], records: Sequence[tuple[str, Connection]]) -> None:
    """See that every trial of a study was run as one of that study, wherever it was run.

    Raises:
        RecordError: two studies claim an arm, or a record has episodes of one and not the study.
    """
    owners: dict[str, WholeStudy] = {}
    for one in studies:
        for _, code, key in one.arms:
            other = owners.setdefault(key, one)
            if other is not one:
                raise RecordError(
                    f"arm {code} of the study {one.title} in {one.record} is an arm of the study {other.title} in "
                    f"{other.record} as well: its trials would count in both",
                    advice="nothing was written; keep these records apart",
                )
    for name, connection in records:
        locked = {key for one in whole_studies(name, connection) for _, _, key in one.arms}
        for key, count in _episodes(connection).items():
            if key in owners and key not in locked:
                code = next(code for _, code, arm in owners[key].arms if arm == key)
                raise RecordError(
                    f"{name} has {count} episodes of arm {code} of the study {owners[key].title} that were run outside "
                    f"of it; the study is locked in {owners[key].record}",
                    advice="nothing was written; keep these records apart",
                )


def _episodes(connection: Connection) -> Mapping[str, int]:
    rows = connection.execute(
        select(Campaign.key, func.count())
        .select_from(Episode)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .group_by(Campaign.key)
    )
    return {row[0]: row[1] for row in rows}


def write_studies(
    mine: Connection,
    studies: Iterable[WholeStudy],
    campaigns: Mapping[str, int],
    trials: Mapping[tuple[int, str, int, int], int],
    process: Callable[[Row], int],
) -> None:
    """Write studies as they were united, within a transaction in which their campaigns and trials are there.

    Args:
        mine: the transaction.
        studies: of a plan made of these very records.
        campaigns: this record's numbers, by key.
        trials: this record's numbers, by campaign, goal, starting position and repetition.
        process: returns this record's number of a process.
    """
    here = {one.identity: one for one in whole_studies("this record", mine)}
    for one in studies:
        there = here.get(one.identity)
        if there is None:
            number = insert_row(mine, Study, {**one.study, "process_id": process(one.process)})
            mine.execute(
                insert(StudyArm),
                [
                    {"study_id": number, "campaign_id": campaigns[key], "name": name, "code": code}
                    for name, code, key in one.arms
                ],
            )
            mine.execute(
                insert(StudyTrial),
                [
                    {
                        "study_id": number,
                        "trial_id": trials[campaigns[key], goal, start, repetition],
                        "rank": rank,
                        "block": block,
                    }
                    for rank, block, key, goal, start, repetition in one.schedule
                ],
            )
        else:
            number = mine.execute(select(Study.id).where(Study.uuid == there.study["uuid"])).scalar_one()
            mine.execute(update(Study).where(Study.id == number).values(one.study))
        fresh = [done for done in one.history if there is None or done not in there.history]
        if fresh:
            rows = [{**done.entry, "study_id": number, "process_id": process(done.process)} for done in fresh]
            mine.execute(insert(StudyEntry), rows)
