"""Writes studies: lock, amendments, unblinding and other entries; each within a transaction."""

import uuid
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, func, insert, select, update

from vsnbench.errors import StudyError
from vsnbench.results.schema.row_encoding import insert_row, text
from vsnbench.results.schema.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.results.schema.tables import EpisodeRow, ProcessRow
from vsnbench.results.studies.entries import AMEND, LOCK, UNBLIND, StudyChange, StudyLock
from vsnbench.results.studies.log import ENTRY, append_event
from vsnbench.results.studies.queries import blind_study_like
from vsnbench.results.writing import campaigns
from vsnbench.results.writing.lifecycle import RESULTS


def lock_study(connection: Connection, lock: StudyLock, process_id: int) -> int:
    """Write a study within a transaction, and return its number; see `Journal.lock_study`."""
    for arm in lock.arms:
        if other := blind_study_like(connection, arm.plan):
            raise StudyError(f"seed {lock.seed} is that of the blinded study {other!r}: choose another seed")
    study = {
        "uuid": str(uuid.uuid4()),
        "title": text(lock.title),
        "content": lock.content,
        "sha256": lock.sha256,
        "locked_sha256": lock.sha256,
        "schedule_sha256": lock.schedule_sha256,
        "seed": lock.seed,
        "blind": lock.blind,
        "locked_at": datetime.now(UTC),
        "unblinded_at": None,
        "process_id": process_id,
        "log_heads": "",
    }
    study_id = insert_row(connection, Study, study)
    trial_ids: dict[tuple[str, str, int, int], int] = {}
    for arm in sorted(lock.arms, key=lambda arm: arm.code):  # so that row numbers do not reveal the arms
        campaign = campaigns.find_or_create(connection, arm.plan, process_id)
        taken = connection.scalar(select(Study.title).join(StudyArm).where(StudyArm.campaign_id == campaign.id))
        if taken is not None:
            raise StudyError(
                f"arm {arm.name} with seed {lock.seed} already belongs to the study {taken!r}: choose another seed"
            )
        ids = [trial.id for trial in campaign.trials]
        if begun := connection.scalar(select(func.count(EpisodeRow.id)).where(EpisodeRow.trial_id.in_(ids))):
            raise StudyError(
                f"arm {arm.name} has {begun} episodes of these trials from before the lock: choose another seed, or "
                "another results directory with --results"
            )
        row = {"study_id": study_id, "campaign_id": campaign.id, "name": text(arm.name), "code": arm.code}
        connection.execute(insert(StudyArm), row)
        trial_ids |= {(arm.name, trial.goal, trial.start, trial.repetition): trial.id for trial in campaign.trials}
    schedule = [
        {
            "study_id": study_id,
            "trial_id": trial_ids[trial.arm, trial.goal, trial.start, trial.repetition],
            "rank": trial.rank,
            "block": trial.block,
        }
        for trial in lock.trials
    ]
    connection.execute(insert(StudyTrial), schedule)
    locked = {
        "plan": lock.sha256,
        "schedule": lock.schedule_sha256,
        "seed": lock.seed,
        "blind": lock.blind,
        "arms": sorted([text(arm.name), arm.code, arm.plan.key] for arm in lock.arms),
    }
    add_entry(connection, study_id, process_id, LOCK, words=lock.sha256, logged=locked)
    return study_id


def add_entry(
    connection: Connection,
    study_id: int,
    process_id: int,
    kind: str,
    *,
    reason: str = "",
    words: str = "",
    logged: Mapping[str, Any] | None = None,
) -> None:
    """Append an entry to the history of a study, with its author and the number of results.

    `logged` is further content for the study's log.
    """
    author = connection.execute(select(ProcessRow.operator).where(ProcessRow.id == process_id)).scalar_one()
    entry = {
        "created_at": datetime.now(UTC),
        "kind": kind,
        "author": author,
        "reason": text(reason),
        "text": text(words),
        "results": _results(connection, study_id),
    }
    connection.execute(insert(StudyEntry), {"study_id": study_id, "process_id": process_id, **entry})
    append_event(connection, study_id, ENTRY, {**(logged or {}), "entry": logged_entry(entry)})


def logged_entry(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return an entry in the format of the log."""
    names = ("kind", "author", "reason", "text", "results")
    moment = entry["created_at"].isoformat(timespec="microseconds")
    return {"created_at": moment, **{name: entry[name] for name in names}}


def amend_study(connection: Connection, study_id: int, process_id: int, change: StudyChange) -> None:
    """Replace the plan of a study within a transaction; see `Journal.amend_study`."""
    changed = {"plan": change.sha256}
    add_entry(connection, study_id, process_id, AMEND, reason=change.reason, words=change.lines, logged=changed)
    connection.execute(
        update(Study)
        .where(Study.id == study_id)
        .values(content=change.content, sha256=change.sha256, title=text(change.title))
    )


def unblind_study(connection: Connection, study_id: int, process_id: int, *, reason: str) -> None:
    """Unblind a study within a transaction; see `Journal.unblind_study`."""
    changed = connection.execute(
        update(Study)
        .where(Study.id == study_id, Study.blind.is_(True), Study.unblinded_at.is_(None))
        .values(unblinded_at=datetime.now(UTC))
    )
    if changed.rowcount != 1:
        raise StudyError("the study is not blinded or was unblinded before")
    add_entry(connection, study_id, process_id, UNBLIND, reason=reason)


def _results(connection: Connection, study_id: int) -> int:
    query = (
        select(func.count(func.distinct(EpisodeRow.trial_id)))
        .join(StudyTrial, StudyTrial.trial_id == EpisodeRow.trial_id)
        .where(StudyTrial.study_id == study_id, EpisodeRow.state.in_([state.value for state in RESULTS]))
    )
    return int(connection.execute(query).scalar_one())
