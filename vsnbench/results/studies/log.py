"""Hash-chained log of a study, appended within the transaction that it records.

Each event contains the hashes of its predecessors, and the study's row contains the hashes of the newest events, so
that edited and deleted events are detected. A merge unites two logs: the next event then has several predecessors.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, Select, bindparam, func, insert, select, update

from vsnbench.protocol.metrics import known_progress
from vsnbench.results.schema.engine import to_json
from vsnbench.results.schema.study_tables import Study, StudyArm, StudyEvent, StudyTrial
from vsnbench.results.schema.tables import EpisodeRow, ProcessRow, SessionRow, TrialRow, VerdictRow

ENTRY, OUTCOME = "entry", "outcome"
"""Kinds of events."""
VERDICT_COLUMNS = (
    *("created_at", "proposed", "success", "end_reason", "distance_m", "distance_source", "goal_instance"),
    *("goal_in_sight", "author", "source", "reason", "note"),
)
"""Columns of a verdict in the log."""
MEASURED_COLUMNS = (
    *("started_at", "end_reason", "actions", "path_length_m", "geodesic_start_m", "geodesic_end_m"),
    *("duration_s", "distance_to_goal_m"),
)
"""Columns of an episode in the log; none of them changes after the episode has ended."""
OUTCOME_VERSION = 2
"""Version of the content of an outcome. Version 1 had no `version` and no `measured`."""


@dataclass(frozen=True, slots=True)
class LogEvent:
    """An event of a study's log."""

    created_at: datetime
    kind: str
    content: str
    """JSON with sorted keys."""
    previous: str
    """Hashes of the preceding events, sorted, separated by spaces."""
    sha256: str

    @property
    def parents(self) -> frozenset[str]:
        """Hashes of the preceding events."""
        return frozenset(self.previous.split())

    @property
    def is_intact(self) -> bool:
        """Whether the hash matches the content."""
        return self.sha256 == event_hash(self.created_at, self.kind, self.content, self.previous)


def event_hash(created_at: datetime, kind: str, content: str, previous: str) -> str:
    """Return the hash of an event, which covers all preceding events through `previous`."""
    moment = created_at.astimezone(UTC).isoformat(timespec="microseconds")
    return hashlib.sha256("\n".join([previous, kind, moment, content]).encode()).hexdigest()


def heads_of(events: Iterable[LogEvent]) -> frozenset[str]:
    """Return the hashes of the events without a successor."""
    known = tuple(events)
    followed = {parent for event in known for parent in event.parents}
    return frozenset(event.sha256 for event in known) - followed


def append_event(connection: Connection, study_id: int, kind: str, content: Mapping[str, Any]) -> None:
    """Append an event to a study's log.

    The study's row stays locked until the transaction ends, so that concurrent processes append one after another.
    """
    locked = select(Study.log_heads).where(Study.id == study_id).with_for_update(key_share=True)
    previous = connection.execute(locked).scalar_one()
    now, words = datetime.now(UTC), to_json(content, in_order=True)
    sha256 = event_hash(now, kind, words, previous)
    row = {"created_at": now, "kind": kind, "content": words, "previous": previous, "sha256": sha256}
    connection.execute(insert(StudyEvent), {"study_id": study_id, **row})
    connection.execute(update(Study).where(Study.id == study_id).values(log_heads=sha256))


_IN_STUDY = (
    select(
        *(StudyTrial.study_id, StudyArm.name, TrialRow.goal, TrialRow.start, TrialRow.repetition),
        *(EpisodeRow.uuid, EpisodeRow.state),
    )
    .select_from(EpisodeRow)
    .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
    .join(StudyTrial, StudyTrial.trial_id == TrialRow.id)
    .join(StudyArm, (StudyArm.campaign_id == TrialRow.campaign_id) & (StudyArm.study_id == StudyTrial.study_id))
    .where(EpisodeRow.id == bindparam("episode"))
)
"""The place of an episode in its study; made once, because that takes longer than executing it."""


def log_outcome(connection: Connection, episode_id: int) -> None:
    """Append the state, verdict and measurements of an episode to its study's log; without a study it does nothing.

    Call it last in a transaction over several episodes, because it locks the study's row.
    """
    found = connection.execute(_IN_STUDY, {"episode": episode_id}).first()
    if found is None:
        return
    verdicts = verdicts_by_episode(connection, [episode_id]).get(episode_id, ())
    content = {
        "version": OUTCOME_VERSION,
        "episode": found.uuid,
        "arm": found.name,
        "goal": found.goal,
        "start": found.start,
        "repetition": found.repetition,
        "state": found.state,
        "verdicts": len(verdicts),
        "verdict": verdicts[-1] if verdicts else None,
        "measured": measured_by_episode(connection, [episode_id])[episode_id],
    }
    append_event(connection, found.study_id, OUTCOME, content)


def verdicts_by_episode(
    connection: Connection, episodes: Sequence[int] | Select[int]
) -> Mapping[int, Sequence[dict[str, Any]]]:
    """Return the verdicts by episode number, oldest first, in the format of the log."""
    columns = [getattr(VerdictRow, name) for name in VERDICT_COLUMNS]
    query = select(VerdictRow.episode_id, *columns).where(VerdictRow.episode_id.in_(episodes)).order_by(VerdictRow.id)
    found: dict[int, list[dict[str, Any]]] = {}
    for row in connection.execute(query).mappings():
        verdict = {**row, "created_at": row["created_at"].isoformat(timespec="microseconds")}
        found.setdefault(verdict.pop("episode_id"), []).append(verdict)
    return found


def measured_by_episode(
    connection: Connection, episodes: Sequence[int] | Select[int]
) -> Mapping[int, Mapping[str, Any]]:
    """Return what was measured of each episode, by its number, in the format of the log.

    These are `MEASURED_COLUMNS`, the progress and the operator.
    """
    columns = [getattr(EpisodeRow, name) for name in MEASURED_COLUMNS]
    query = (
        select(EpisodeRow.id, func.coalesce(SessionRow.operator, ProcessRow.operator).label("operator"), *columns)
        .join(ProcessRow, ProcessRow.id == EpisodeRow.process_id)
        .outerjoin(SessionRow, SessionRow.id == EpisodeRow.session_id)
        .where(EpisodeRow.id.in_(episodes))
    )
    found: dict[int, Mapping[str, Any]] = {}
    for row in connection.execute(query).mappings():
        measured = {name: value for name, value in row.items() if name != "id"}
        measured["started_at"] = row["started_at"].isoformat(timespec="microseconds")
        measured["progress"] = known_progress(row["geodesic_start_m"], row["geodesic_end_m"])
        found[row["id"]] = measured
    return found


def events_of(connection: Connection, study_id: int) -> tuple[LogEvent, ...]:
    """Return a study's log, oldest event first."""
    columns = [getattr(StudyEvent, name) for name in LogEvent.__dataclass_fields__]
    rows = connection.execute(
        select(*columns).where(StudyEvent.study_id == study_id).order_by(StudyEvent.created_at, StudyEvent.id)
    )
    return tuple(LogEvent(**row) for row in rows.mappings())
