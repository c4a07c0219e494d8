"""Writes and reads sessions: one operator with one robot.

A session begins with the first trial that its operator starts. It ends when another operator takes over, when the
operator leaves, or by recovery when its process has died.
"""

import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, Engine, Row, func, select, update

from vsnbench.results.fields import fields_of, quantity
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.schema.row_encoding import AT_START, AT_STOP, insert_row, text
from vsnbench.results.schema.row_encoding import Row as Columns
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, EventRow, SessionRow, TrialRow
from vsnbench.results.writing.entries import INTERVENTION
from vsnbench.results.writing.lifecycle import ACTIVE
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.placement import PoseCovariance
from vsnbench.values.pose import Pose


@dataclass(frozen=True, slots=True)
class RecordedSession:
    """The session of an episode."""

    uuid: str = quantity("identity of the session in every record", SessionRow.uuid)
    operator: str = quantity("name of the operator", SessionRow.operator)
    began_at: datetime = quantity("time of its beginning", SessionRow.began_at)
    ended_at: datetime | None = quantity("time of its end", SessionRow.ended_at, absent="while it is open")
    words: str = quantity("why it ended; empty if the operator left", SessionRow.words)


_SESSION = fields_of(RecordedSession)


@dataclass(frozen=True, slots=True)
class RecordedPlacement:
    """A measured start pose of a robot."""

    author: str = quantity("operator who accepted the placement; empty if it was not accepted")
    created_at: datetime = quantity("time of the measurement")
    method: str = quantity("`look` (one depth image), `turn` (a turn on the spot) or `drive` (the last steps)")
    looks: int = quantity("number of depth images")
    pose: Fix = quantity("measured pose")
    covariance: PoseCovariance = quantity("covariance of the pose in the site's frame")
    offset: Pose = quantity("offset from the starting position, after STOP from the pose by odometry: x ahead, y left")
    determined: bool = quantity("the images determine the pose")
    within_tolerance: bool = quantity("the robot was within the tolerance of the starting position")
    undetermined: tuple[str, ...] = quantity("directions that the images left open")
    moved: tuple[str, ...] = quantity("ids of objects that are not where the site file has them")
    depth_scale: float = quantity("correction factor of the depth camera's distances")
    words: str = quantity("result in one line")


@dataclass(frozen=True, slots=True)
class RecordedStop(RecordedPlacement):
    """A pose measured after STOP; its offset is that from the pose by the odometry."""

    distance_m: float | None = quantity("distance to the goal from the measured pose", absent="if not determined")
    distance_low_m: float | None = quantity("least distance from its 95 % region", absent="if not determined")
    distance_high_m: float | None = quantity(
        "greatest distance from its 95 % region", absent="if not determined or not bounded"
    )
    odometry_m: float | None = quantity("distance to the goal from the pose by the odometry")
    odometry_low_m: float | None = quantity("least distance from the 95 % region of that pose")
    odometry_high_m: float | None = quantity("greatest distance from that region", absent="if it is not bounded")
    verdicts_differ: bool = quantity("STOP succeeds by one of the two poses and fails by the other")


_OF_STOP = tuple(RecordedStop.__annotations__)


def join_session(connection: Connection, process_id: int, episode_id: int, operator: str) -> None:
    """Assign an active episode of this process to its operator's session, which is started if needed."""
    mine = EpisodeRow.id == episode_id, EpisodeRow.process_id == process_id
    active = EpisodeRow.state.in_([state.value for state in ACTIVE])
    robot_id = connection.scalar(
        select(CampaignRow.robot_id)
        .join(TrialRow, TrialRow.campaign_id == CampaignRow.id)
        .join(EpisodeRow, EpisodeRow.trial_id == TrialRow.id)
        .where(*mine, active)
    )
    if robot_id is None:
        return  # the claim is lost; the next step reports it
    operator = text(operator)
    lasting = SessionRow.process_id == process_id, SessionRow.ended_at.is_(None)
    own = SessionRow.operator == operator, SessionRow.robot_id == robot_id
    session_id = connection.scalar(select(SessionRow.id).where(*lasting, *own))
    if session_id is None:
        end_sessions(connection, process_id, f"{operator} took over")
        now = datetime.now(UTC)
        row = {"process_id": process_id, "robot_id": robot_id, "operator": operator, "began_at": now, "words": ""}
        session_id = insert_row(connection, SessionRow, {"uuid": str(uuid.uuid4()), **row})
    connection.execute(update(EpisodeRow).where(*mine).values(session_id=session_id))


def end_sessions(connection: Connection, process_id: int, words: str = "") -> None:
    """End the open sessions of a process."""
    lasting = SessionRow.process_id == process_id, SessionRow.ended_at.is_(None)
    connection.execute(update(SessionRow).where(*lasting).values(ended_at=datetime.now(UTC), words=text(words)))


def end_orphaned_session(connection: Connection, session_id: int) -> None:
    """End a session whose process has died, at its last recorded activity."""
    last = select(func.max(func.coalesce(EpisodeRow.ended_at, EpisodeRow.started_at), type_=EpisodeRow.started_at.type))
    died_at = connection.scalar(last.where(EpisodeRow.session_id == session_id))
    connection.execute(
        update(SessionRow)
        .where(SessionRow.id == session_id, SessionRow.ended_at.is_(None))
        .values(ended_at=SessionRow.began_at if died_at is None else died_at, words="its process died")
    )


def session_of(connection: Connection, episode_id: int) -> RecordedSession | None:
    """Return the session of an episode; None without an operator."""
    row = connection.execute(
        select(*_SESSION.columns())
        .join(EpisodeRow, EpisodeRow.session_id == SessionRow.id)
        .where(EpisodeRow.id == episode_id)
    ).first()
    return None if row is None else next(_SESSION.read(RecordedSession, [row]))


def placement_of(connection: Connection, episode_id: int) -> RecordedPlacement | None:
    """Return the measured start pose of an episode; None if it was not measured."""
    row = _measured(connection, episode_id, AT_START)
    return None if row is None else RecordedPlacement(**_placement(row))


def stop_of(connection: Connection, episode_id: int) -> RecordedStop | None:
    """Return the pose measured after the STOP of an episode; None if it was not measured."""
    row = _measured(connection, episode_id, AT_STOP)
    if row is None:
        return None
    return RecordedStop(**_placement(row), **{name: getattr(row, name) for name in _OF_STOP})


def _measured(connection: Connection, episode_id: int, moment: str) -> Row[Any] | None:
    query = select(Placement.__table__).where(Placement.episode_id == episode_id, Placement.moment == moment)
    return connection.execute(query).first()


def _placement(row: Row[Any]) -> dict[str, Any]:
    return {
        "author": row.author,
        "created_at": row.created_at,
        "method": row.method,
        "looks": row.looks,
        "pose": Fix(Pose(row.x_m, row.y_m, row.heading_rad), PoseSource.MEASURED),
        "covariance": PoseCovariance(*row.covariance),
        "offset": Pose(row.ahead_m, row.left_m, row.turn_rad),
        "determined": row.determined,
        "within_tolerance": row.within_tolerance,
        "undetermined": tuple(row.undetermined),
        "moved": tuple(row.moved),
        "depth_scale": row.depth_scale,
        "words": row.words,
    }


def interventions_in(engine: Engine, campaigns: Sequence[int]) -> int:
    """Return the number of operator interventions in these campaigns.

    Raises:
        RecordError: the database cannot be read.
    """
    query = (
        select(func.count(EventRow.id))
        .join(EpisodeRow, EpisodeRow.id == EventRow.episode_id)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .where(EventRow.kind == INTERVENTION, TrialRow.campaign_id.in_(campaigns))
    )
    with transaction(reading(engine)) as connection:
        return int(connection.scalar(query) or 0)


def session_row(connection: Connection, session_id: int | None) -> Columns | None:
    """Return the content of a session without foreign keys; None for None."""
    if session_id is None:
        return None
    query = select(*_SESSION.columns()).where(SessionRow.id == session_id)
    return dict(connection.execute(query).mappings().one())


def find_or_insert_session(connection: Connection, row: Columns, process_id: int, robot_id: int) -> int:
    """Return the number of another record's session; a copy of an open session is updated with its end."""
    known = connection.execute(select(SessionRow.id, SessionRow.ended_at).where(SessionRow.uuid == row["uuid"])).first()
    if known is None:
        return insert_row(connection, SessionRow, {**row, "process_id": process_id, "robot_id": robot_id})
    if known.ended_at is None and row["ended_at"] is not None:
        ended = {"ended_at": row["ended_at"], "words": row["words"]}
        connection.execute(update(SessionRow).where(SessionRow.id == known.id).values(ended))
    return int(known.id)
