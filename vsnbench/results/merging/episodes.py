"""An ended episode with its dependent rows: read from one record, compared, and inserted into another.

Numbers are specific to a record and assigned anew; the UUID identifies the episode.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Column, Connection, Table, insert, select

from vsnbench.results.schema.base import Base
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.schema.row_encoding import Row, insert_row
from vsnbench.results.schema.tables import Campaign, Episode, Event, Process, Step, Trial, Verdict
from vsnbench.results.writing.campaigns import Trial as PlannedTrial
from vsnbench.results.writing.episodes import attach_images
from vsnbench.results.writing.sessions import find_or_insert_session, session_row
from vsnbench.values.encoding.image_digest import Pixels, StepDigests, algorithm, compare_digests


@dataclass(frozen=True, slots=True)
class OtherRecord:
    """A record of a merge, open for reading as a snapshot."""

    name: str
    """Display name."""
    connection: Connection


@dataclass(frozen=True, slots=True)
class EpisodeRows:
    """An episode as plain rows, without record-specific numbers."""

    uuid: str
    campaign_key: str
    trial: PlannedTrial
    process: Row
    """Row of the process that ran the episode."""
    episode: Row
    steps: tuple[Row, ...]
    verdicts: tuple[Row, ...]
    """In chronological order."""
    events: tuple[Row, ...]
    session: Row | None
    """Row of the operator session, if any."""
    placement: Row | None
    """Measured start pose, if any."""


def columns_of(table: type[Base], *without: str) -> list[Column[Any]]:
    """Return the columns of a table except the named ones."""
    found: Table = table.metadata.tables[table.__tablename__]
    return [column for column in found.columns if column.name not in without]


_PROCESS = columns_of(Process, "id")
_EPISODE = columns_of(Episode, "id", "trial_id", "process_id", "session_id", "images_directory")
_STEP = columns_of(Step, "episode_id")
_NOT_COMPARED = (Episode.state.key, Episode.thinking_s.key)
"""Columns that follow from verdicts, and from steps: two databases may add these in another order."""
_DIGESTS = (Step.rgb_digest.key, Step.depth_digest.key)
_VERDICT = columns_of(Verdict, "id", "episode_id")
_PLACEMENT = columns_of(Placement, "id", "episode_id")
_EVENT = columns_of(Event, "id", "campaign_id", "episode_id")


def read_episode_rows(connection: Connection, episode_id: int, *, steps: bool = True) -> EpisodeRows:
    """Return an episode of a record, optionally without its steps.

    Raises:
        NoResultFound: the episode does not exist.
    """
    trial = (
        select(Campaign.key, Trial.goal, Trial.start, Trial.repetition, Episode.process_id, Episode.session_id)
        .select_from(Episode)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .where(Episode.id == episode_id)
    )
    key, goal, start, repetition, process_id, session_id = connection.execute(trial).one()
    (process,) = _rows(connection, _PROCESS, Process.id == process_id)
    (episode,) = _rows(connection, _EPISODE, Episode.id == episode_id)
    return EpisodeRows(
        uuid=episode["uuid"],
        campaign_key=key,
        trial=PlannedTrial(goal, start, repetition),
        process=process,
        episode=episode,
        steps=_rows(connection, _STEP, Step.episode_id == episode_id, Step.number) if steps else (),
        verdicts=_rows(connection, _VERDICT, Verdict.episode_id == episode_id, Verdict.id),
        events=_rows(connection, _EVENT, Event.episode_id == episode_id, Event.id),
        session=session_row(connection, session_id),
        placement=next(iter(_rows(connection, _PLACEMENT, Placement.episode_id == episode_id)), None),
    )


def _rows(connection: Connection, columns: Sequence[Column[Any]], where: Any, order: Any = None) -> tuple[Row, ...]:
    query = select(*columns).where(where)
    found = connection.execute(query if order is None else query.order_by(order))
    return tuple(dict(row) for row in found.mappings())


def step_digests(connection: Connection, episode_id: int) -> list[StepDigests]:
    """Return the image digests of an episode's steps, in order."""
    columns = (Step.number, Step.rgb_digest, Step.depth_digest, Step.rgb_file_digest, Step.depth_file_digest)
    query = select(*columns).where(Step.episode_id == episode_id).order_by(Step.number)
    return [StepDigests(*row) for row in connection.execute(query)]


def insert_episode_rows(
    connection: Connection, whole: EpisodeRows, trial_id: int, process_id: int, *, has_files: bool
) -> int | None:
    """Insert an ended episode within a transaction and return its new number; None if its UUID exists.

    The numbers of its trial and process are those in this record. With files, the row names their directory.
    """
    if connection.execute(select(Episode.id).where(Episode.uuid == whole.uuid)).first() is not None:
        return None
    given = {**whole.episode, "trial_id": trial_id, "process_id": process_id, "images_directory": ""}
    if whole.session is not None:
        robot_id = connection.scalars(
            select(Campaign.robot_id).join(Trial, Trial.campaign_id == Campaign.id).where(Trial.id == trial_id)
        ).one()
        given["session_id"] = find_or_insert_session(connection, whole.session, process_id, robot_id)
    number = insert_row(connection, Episode, given)
    if whole.placement is not None:
        insert_row(connection, Placement, {**whole.placement, "episode_id": number})
    if has_files:
        attach_images(connection, number)
    add_rows(connection, Step, number, whole.steps)
    add_rows(connection, Verdict, number, whole.verdicts)
    add_rows(connection, Event, number, whole.events)
    return number


def add_rows(connection: Connection, table: type[Base], episode_id: int, rows: Sequence[Row]) -> None:
    """Append steps, verdicts or events of another record to an episode."""
    if rows:
        connection.execute(insert(table), [{**row, "episode_id": episode_id} for row in rows])


def missing_events(ours: Sequence[Row], theirs: Sequence[Row]) -> list[Row]:
    """Return the events of one record that the other lacks."""
    return [event for event in theirs if event not in ours]


def difference(mine: EpisodeRows, theirs: EpisodeRows) -> str:
    """Return how two records contradict each other about an episode, or an empty string.

    Verdicts and events are append-only, so one record may have more of them; the shorter list of verdicts must be the
    beginning of the longer one.
    """
    if (mine.campaign_key, mine.trial) != (theirs.campaign_key, theirs.trial):
        return "it belongs to another trial"
    if mine.process != theirs.process:
        return "its process differs"
    changed = sorted(
        name for name, value in mine.episode.items() if name not in _NOT_COMPARED and theirs.episode[name] != value
    )
    if changed:
        return f"its {changed[0]} differs"
    if mine.placement != theirs.placement:
        return "its measured start pose differs"
    if (mine.session and mine.session["uuid"]) != (theirs.session and theirs.session["uuid"]):
        return "its session differs"
    if mine.steps != theirs.steps:
        return _difference_of_steps(mine.steps, theirs.steps)
    shared = min(len(mine.verdicts), len(theirs.verdicts))
    if mine.verdicts[:shared] != theirs.verdicts[:shared]:
        return "its verdicts contradict each other"
    return ""


def _difference_of_steps(mine: Sequence[Row], theirs: Sequence[Row]) -> str:
    """Return how steps differ; digests of different algorithms cannot be compared."""
    if [_without_digests(step) for step in mine] != [_without_digests(step) for step in theirs]:
        return "its steps differ"
    for ours, other in zip(mine, theirs, strict=True):
        for name in _DIGESTS:
            compared = compare_digests(ours[name], other[name])
            if compared is Pixels.NOT_COMPARABLE:
                made_with = f"{algorithm(ours[name])} and {algorithm(other[name])}"
                return f"the {name} of its step {ours['number']}, made with {made_with}, cannot be compared"
            if compared is Pixels.OTHER:
                return f"the {name} of its step {ours['number']} differs"
    return ""


def _without_digests(step: Row) -> Row:
    return {name: value for name, value in step.items() if name not in _DIGESTS}
