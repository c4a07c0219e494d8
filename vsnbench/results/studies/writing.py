"""Writes studies: lock, amendments, unblinding and other entries; each within a transaction."""

import uuid
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, func, insert, select, update

from vsnbench.errors import StudyError
from vsnbench.results.schema.row_encoding import insert_row, text
from vsnbench.results.schema.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.results.schema.tables import Episode, Process
from vsnbench.results.studies.entries import AMEND, LOCK, UNBLIND, StudyChange, StudyLock
from vsnbench.results.studies.log import ENTRY, append_event
from vsnbench.results.studies.queries import blind_study_like
from vsnbench.results.writing import campaigns
from vsnbench.results.writing.lifecycle import RESULTS


def lock_study(connection: Connection, lock: StudyLock, process_id: int) -> int:
    """Write a study with its campaigns, their trials and the schedule, and return its number.

    Raises:
        StudyError: a campaign belongs to another study, or one of the trials has episodes.
    """
    for arm in lock.arms:
        if other := blind_study_like(connection, arm.plan):
            raise StudyError(f"seed {lock.seed} is that of the blinded study {other!r}: choose another seed")
    study_id = insert_row(
        connection,
        Study,
        {
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
        },
    )
    trial_ids: dict[tuple[str, str, int, int], int] = {}
    for arm in sorted(lock.arms, key=lambda arm: arm.code):  # so that row numbers do not reveal the arms
        campaign = campaigns.find_or_create(connection, arm.plan, process_id)
        taken = connection.execute(
            select(Study.title).join(StudyArm).where(StudyArm.campaign_id == campaign.id)
        ).scalar()
        if taken is not None:
            raise StudyError(
                f"arm {arm.name} with seed {lock.seed} already belongs to the study {taken!r}: choose another seed"
            )
        ids = [trial.id for trial in campaign.trials]
        begun = connection.execute(
            select(func.count()).select_from(Episode).where(Episode.trial_id.in_(ids))
        ).scalar_one()
        if begun:
            raise StudyError(
                f"arm {arm.name} has {begun} episodes of these trials from before the lock: choose another seed, or "
                "another results directory with --results"
            )
        connection.execute(
            insert(StudyArm),
            {"study_id": study_id, "campaign_id": campaign.id, "name": text(arm.name), "code": arm.code},
        )
        trial_ids |= {(arm.name, trial.goal, trial.start, trial.repetition): trial.id for trial in campaign.trials}
    connection.execute(
        insert(StudyTrial),
        [
            {
                "study_id": study_id,
                "trial_id": trial_ids[trial.arm, trial.goal, trial.start, trial.repetition],
                "rank": trial.rank,
                "block": trial.block,
            }
            for trial in lock.trials
        ],
    )
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
    author = connection.execute(select(Process.operator).where(Process.id == process_id)).scalar_one()
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
    """Replace the plan of a study, and record the changes, the author and the reason."""
    changed = {"plan": change.sha256}
    add_entry(connection, study_id, process_id, AMEND, reason=change.reason, words=change.lines, logged=changed)
    connection.execute(
        update(Study)
        .where(Study.id == study_id)
        .values(content=change.content, sha256=change.sha256, title=text(change.title))
    )


def unblind_study(connection: Connection, study_id: int, process_id: int, *, reason: str) -> None:
    """Unblind a study for good.

    Raises:
        StudyError: the study is not blinded.
    """
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
        select(func.count(func.distinct(Episode.trial_id)))
        .join(StudyTrial, StudyTrial.trial_id == Episode.trial_id)
        .where(StudyTrial.study_id == study_id, Episode.state.in_([state.value for state in RESULTS]))
    )
    return int(connection.execute(query).scalar_one())
