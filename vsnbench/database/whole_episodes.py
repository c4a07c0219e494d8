"""An ended episode with all that hangs on it, as rows: read from one record, compared, and inserted into another.

Numbers belong to a record and are given anew; the UUID is the episode's own, and tells it from every other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Column, Connection, Table, insert, select, update

from vsnbench.database.campaign_plan import PlannedTrial
from vsnbench.database.episodes import images_directory
from vsnbench.database.lifecycle import EpisodeState
from vsnbench.database.placement_tables import Placement
from vsnbench.database.row_encoding import Row, insert_row
from vsnbench.database.sessions import find_or_insert_session, session_row
from vsnbench.database.tables import Base, Campaign, Episode, Event, Process, Step, Trial, Verdict
from vsnbench.protocol.image_digest import Pixels, algorithm, compare_digests


@dataclass(frozen=True, slots=True)
class WholeEpisode:
    """An episode as another record can take it: rows of plain values, without the numbers of the record they are in."""

    uuid: str
    campaign_key: str
    trial: PlannedTrial
    process: Row
    """The process that ran it, as `process` has it."""
    episode: Row
    steps: tuple[Row, ...]
    verdicts: tuple[Row, ...]
    """In the order in which they were given."""
    events: tuple[Row, ...]
    session: Row | None
    """Whom it was run by, where somebody stood beside the robot."""
    placement: Row | None
    """Where the robot stood at the start, where that was measured."""

    @property
    def state(self) -> EpisodeState:
        """Where it stands: after its latest judgement, and before any as it ended."""
        return EpisodeState(self.episode["state"])


def columns_of(table: type[Base], *without: str) -> list[Column[Any]]:
    """Return the columns of a table but those named: what a row says by itself, in any record."""
    found: Table = table.metadata.tables[table.__tablename__]
    return [column for column in found.columns if column.name not in without]


_PROCESS = columns_of(Process, "id")
_EPISODE = columns_of(Episode, "id", "trial_id", "process_id", "session_id", "images_directory")
_STEP = columns_of(Step, "episode_id")
_DIGESTS = (Step.rgb_digest.key, Step.depth_digest.key)
_VERDICT = columns_of(Verdict, "id", "episode_id")
_PLACEMENT = columns_of(Placement, "id", "episode_id")
_EVENT = columns_of(Event, "id", "campaign_id", "episode_id")


def read_whole(connection: Connection, episode_id: int, *, steps: bool = True) -> WholeEpisode:
    """Return an episode of a record; without its steps where they are not asked for.

    Raises:
        NoResultFound: there is no such episode.
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
    return WholeEpisode(
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


def insert_whole(
    connection: Connection, whole: WholeEpisode, trial_id: int, process_id: int, *, has_files: bool
) -> int | None:
    """Insert an episode within a transaction and return its new number; None where its UUID is there already.

    Args:
        connection: a transaction that may write.
        whole: the episode; it has ended.
        trial_id: of the same trial, in this record.
        process_id: of the process that ran it, in this record.
        has_files: it has images; `images_directory` of its number is where they belong.
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
        placed = {"images_directory": images_directory(number)}
        connection.execute(update(Episode).where(Episode.id == number).values(placed))
    if whole.steps:
        connection.execute(insert(Step), [{**step, "episode_id": number} for step in whole.steps])
    add_verdicts(connection, number, whole.verdicts)
    add_events(connection, number, whole.events)
    return number


def add_verdicts(connection: Connection, episode_id: int, verdicts: Sequence[Row]) -> None:
    """Append verdicts as another record has them; the caller sets the state that follows."""
    if verdicts:
        connection.execute(insert(Verdict), [{**verdict, "episode_id": episode_id} for verdict in verdicts])


def add_events(connection: Connection, episode_id: int, events: Sequence[Row]) -> None:
    """Append events of an episode as another record has them."""
    if events:
        connection.execute(insert(Event), [{**event, "episode_id": episode_id} for event in events])


def missing_events(ours: Sequence[Row], theirs: Sequence[Row]) -> list[Row]:
    """Return the events that one record has and the other lacks."""
    return [event for event in theirs if event not in ours]


def difference(mine: WholeEpisode, theirs: WholeEpisode) -> str:
    """Return in words where two records contradict each other about one episode; empty where they do not.

    Verdicts and events are only ever added, so one record may have more of them than the other; the verdicts of one
    must then be the beginning of the other's.
    """
    if (mine.campaign_key, mine.trial) != (theirs.campaign_key, theirs.trial):
        return "it is an episode of another trial"
    if mine.process != theirs.process:
        return "another process ran it"
    changed = sorted(name for name, value in mine.episode.items() if name != "state" and theirs.episode[name] != value)
    if changed:
        return f"its {changed[0]} is another"
    if mine.placement != theirs.placement:
        return "where it stood at the start is another"
    if (mine.session and mine.session["uuid"]) != (theirs.session and theirs.session["uuid"]):
        return "it was run in another session"
    if mine.steps != theirs.steps:
        return _difference_of_steps(mine.steps, theirs.steps)
    shared = min(len(mine.verdicts), len(theirs.verdicts))
    if mine.verdicts[:shared] != theirs.verdicts[:shared]:
        return "it was judged differently in each"
    return ""


def _difference_of_steps(mine: Sequence[Row], theirs: Sequence[Row]) -> str:
    """Return in words how unequal steps differ; where digests alone do, whether that says that the images do."""
    if [_without_digests(step) for step in mine] != [_without_digests(step) for step in theirs]:
        return "its steps are others"
    for ours, other in zip(mine, theirs, strict=True):
        for name in _DIGESTS:
            said = compare_digests(ours[name], other[name])
            if said is Pixels.NOT_COMPARABLE:
                made_with = f"{algorithm(ours[name])} and {algorithm(other[name])}"
                return f"the {name} of its step {ours['number']}, made with {made_with}, cannot be compared"
            if said is Pixels.OTHER:
                return f"the {name} of its step {ours['number']} is another"
    return ""


def _without_digests(step: Row) -> Row:
    return {name: value for name, value in step.items() if name not in _DIGESTS}
