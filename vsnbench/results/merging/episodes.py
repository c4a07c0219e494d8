"""An ended episode with its dependent rows: read from one record, compared, and inserted into another.

Numbers are specific to a record and assigned anew; the UUID identifies the episode.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Column, Connection, Table, insert, select

from vsnbench.results.files.images import step_digests_of
from vsnbench.results.schema.base import TableBase
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.schema.row_encoding import Row, insert_row
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, EventRow, ProcessRow, StepRow, TrialRow, VerdictRow
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.episodes import attach_images
from vsnbench.results.writing.sessions import find_or_insert_session, session_row
from vsnbench.values.decision_check import SENSING
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
    trial: Trial
    process: Row
    """Row of the process that ran the episode."""
    episode: Row
    steps: tuple[Row, ...]
    verdicts: tuple[Row, ...]
    """In chronological order."""
    events: tuple[Row, ...]
    session: Row | None
    """Row of the operator session, if any."""
    placements: tuple[Row, ...]
    """Measured poses at the start and after STOP."""


def columns_of(table: type[TableBase], *without: str) -> list[Column[Any]]:
    """Return the columns of a table except the named ones."""
    found: Table = table.metadata.tables[table.__tablename__]
    return [column for column in found.columns if column.name not in without]


_PROCESS = columns_of(ProcessRow, "id")
_EPISODE = columns_of(EpisodeRow, "id", "trial_id", "process_id", "session_id", "images_directory")
_STEP = columns_of(StepRow, "episode_id")
_NOT_COMPARED = (EpisodeRow.state.key, EpisodeRow.thinking_s.key)
"""Columns that follow from verdicts, and from steps: two databases may add these in another order."""
_DIGESTS = (StepRow.rgb_digest.key, StepRow.depth_digest.key)
_VERDICT = columns_of(VerdictRow, "id", "episode_id")
_PLACEMENT = columns_of(Placement, "id", "episode_id")
_EVENT = columns_of(EventRow, "id", "campaign_id", "episode_id")


def read_episode_rows(connection: Connection, episode_id: int, *, steps: bool = True) -> EpisodeRows:
    """Return an episode of a record, optionally without its steps.

    Raises:
        NoResultFound: the episode does not exist.
    """
    trial = (
        select(
            CampaignRow.key,
            TrialRow.goal,
            TrialRow.start,
            TrialRow.repetition,
            EpisodeRow.process_id,
            EpisodeRow.session_id,
        )
        .select_from(EpisodeRow)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .where(EpisodeRow.id == episode_id)
    )
    key, goal, start, repetition, process_id, session_id = connection.execute(trial).one()
    (process,) = _rows(connection, _PROCESS, ProcessRow.id == process_id)
    (episode,) = _rows(connection, _EPISODE, EpisodeRow.id == episode_id)
    return EpisodeRows(
        uuid=episode["uuid"],
        campaign_key=key,
        trial=Trial(goal, start, repetition),
        process=process,
        episode=episode,
        steps=_rows(connection, _STEP, StepRow.episode_id == episode_id, StepRow.number) if steps else (),
        verdicts=_rows(connection, _VERDICT, VerdictRow.episode_id == episode_id, VerdictRow.id),
        events=_rows(connection, _EVENT, EventRow.episode_id == episode_id, EventRow.id),
        session=session_row(connection, session_id),
        placements=_rows(connection, _PLACEMENT, Placement.episode_id == episode_id, Placement.moment),
    )


def _rows(connection: Connection, columns: Sequence[Column[Any]], where: Any, order: Any = None) -> tuple[Row, ...]:
    query = select(*columns).where(where)
    found = connection.execute(query if order is None else query.order_by(order))
    return tuple(dict(row) for row in found.mappings())


def step_digests(connection: Connection, episode_id: int) -> list[StepDigests]:
    """Return the image digests of an episode's steps, in order."""
    columns = (
        StepRow.number,
        StepRow.rgb_digest,
        StepRow.depth_digest,
        StepRow.rgb_file_digest,
        StepRow.depth_file_digest,
        StepRow.details[SENSING],
    )
    query = select(*columns).where(StepRow.episode_id == episode_id).order_by(StepRow.number)
    return [
        step_digests_of(number, rgb, depth, (rgb_file, depth_file), {SENSING: sensing})
        for number, rgb, depth, rgb_file, depth_file, sensing in connection.execute(query)
    ]


def insert_episode_rows(
    connection: Connection, whole: EpisodeRows, trial_id: int, process_id: int, *, has_files: bool
) -> int | None:
    """Insert an ended episode within a transaction and return its new number; None if its UUID exists.

    The numbers of its trial and process are those in this record. With files, the row names their directory.
    """
    if connection.execute(select(EpisodeRow.id).where(EpisodeRow.uuid == whole.uuid)).first() is not None:
        return None
    given = {**whole.episode, "trial_id": trial_id, "process_id": process_id, "images_directory": ""}
    if whole.session is not None:
        robot_id = connection.scalars(
            select(CampaignRow.robot_id)
            .join(TrialRow, TrialRow.campaign_id == CampaignRow.id)
            .where(TrialRow.id == trial_id)
        ).one()
        given["session_id"] = find_or_insert_session(connection, whole.session, process_id, robot_id)
    number = insert_row(connection, EpisodeRow, given)
    if has_files:
        attach_images(connection, number)
    add_rows(connection, Placement, number, whole.placements)
    add_rows(connection, StepRow, number, whole.steps)
    add_rows(connection, VerdictRow, number, whole.verdicts)
    add_rows(connection, EventRow, number, whole.events)
    return number


def add_rows(connection: Connection, table: type[TableBase], episode_id: int, rows: Sequence[Row]) -> None:
    """Append rows of another record to an episode: steps, verdicts, events, measured poses."""
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
    if mine.placements != theirs.placements:
        return "its measured pose differs"
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
