"""Writes studies: the lock, all of it or nothing, and what is done to a study afterwards; each within a transaction."""

import uuid
from datetime import UTC, datetime

from sqlalchemy import Connection, func, insert, select, update

from vsnbench.database import campaign_plan
from vsnbench.database.lifecycle import RESULTS
from vsnbench.database.row_encoding import insert_row, text
from vsnbench.database.study_entries import AMEND, LOCK, UNBLIND, StudyChange, StudyLock
from vsnbench.database.study_tables import Study, StudyArm, StudyEntry, StudyTrial
from vsnbench.database.tables import Episode, Process
from vsnbench.errors import StudyError


def lock_study(connection: Connection, lock: StudyLock, process_id: int) -> int:
    """Write a study with its campaigns, their trials and the schedule, and return its number.

    Raises:
        StudyError: a campaign is another study's, or a trial has been begun before the plan was locked.
    """
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
        },
    )
    trial_ids: dict[tuple[str, str, int, int], int] = {}
    for arm in sorted(lock.arms, key=lambda one: one.code):  # so that no number in the record tells the arms apart
        campaign = campaign_plan.find_or_create(connection, arm.plan, process_id)
        taken = connection.execute(
            select(Study.title).join(StudyArm).where(StudyArm.campaign_id == campaign.id)
        ).scalar()
        if taken is not None:
            raise StudyError(
                f"arm {arm.name} with seed {lock.seed} belongs to the study {taken!r} already: choose another seed"
            )
        ids = [trial.id for trial in campaign.trials]
        begun = connection.execute(
            select(func.count()).select_from(Episode).where(Episode.trial_id.in_(ids))
        ).scalar_one()
        if begun:
            raise StudyError(
                f"arm {arm.name} has {begun} episodes of these trials in this record, run before the plan was locked: "
                "choose another seed, or another results directory with --results"
            )
        connection.execute(
            insert(StudyArm),
            {"study_id": study_id, "campaign_id": campaign.id, "name": text(arm.name), "code": arm.code},
        )
        trial_ids |= {(arm.name, one.goal, one.start, one.repetition): one.id for one in campaign.trials}
    connection.execute(
        insert(StudyTrial),
        [
            {
                "study_id": study_id,
                "trial_id": trial_ids[one.arm, one.goal, one.start, one.repetition],
                "rank": one.rank,
                "block": one.block,
            }
            for one in lock.trials
        ],
    )
    add_entry(connection, study_id, process_id, LOCK, words=lock.sha256)
    return study_id


def add_entry(
    connection: Connection, study_id: int, process_id: int, kind: str, *, reason: str = "", words: str = ""
) -> None:
    """Append to what was done to a study, with who did it and how many trials had a result by then."""
    author = connection.execute(select(Process.operator).where(Process.id == process_id)).scalar_one()
    connection.execute(
        insert(StudyEntry),
        {
            "study_id": study_id,
            "process_id": process_id,
            "created_at": datetime.now(UTC),
            "kind": kind,
            "author": author,
            "reason": text(reason),
            "text": text(words),
            "results": _results(connection, study_id),
        },
    )


def amend_study(connection: Connection, study_id: int, process_id: int, change: StudyChange) -> None:
    """Let another text be the plan, and keep what changed, who changed it and why."""
    add_entry(connection, study_id, process_id, AMEND, reason=change.reason, words=change.lines)
    connection.execute(
        update(Study)
        .where(Study.id == study_id)
        .values(content=change.content, sha256=change.sha256, title=text(change.title))
    )


def unblind_study(connection: Connection, study_id: int, process_id: int, *, reason: str) -> None:
    """Give the arms their names back, for everybody and for ever.

    Raises:
        StudyError: it is not blind.
    """
    changed = connection.execute(
        update(Study)
        .where(Study.id == study_id, Study.blind.is_(True), Study.unblinded_at.is_(None))
        .values(unblinded_at=datetime.now(UTC))
    )
    if changed.rowcount != 1:
        raise StudyError("this study is not blind (any more)")
    add_entry(connection, study_id, process_id, UNBLIND, reason=reason)


def _results(connection: Connection, study_id: int) -> int:
    query = (
        select(func.count(func.distinct(Episode.trial_id)))
        .join(StudyTrial, StudyTrial.trial_id == Episode.trial_id)
        .where(StudyTrial.study_id == study_id, Episode.state.in_([state.value for state in RESULTS]))
    )
    return int(connection.execute(query).scalar_one())
