"""The life of an episode as data: its states, which may follow which, and the one function that moves it on.

    claimed -> placed -> running -> awaiting judgement -> judged
                                                       -> void

A trial is claimed before a person is asked to wheel the robot to its mark; the robot is placed when its start pose is
confirmed; it runs until it ends. What the protocol can decide by itself is judged at once; what only a person can
confirm (a real robot's result, an imported log) awaits that person's word and counts nowhere before. A judgement may
be amended for ever: a judged episode becomes void and a void one judged, by a new verdict and never by forgetting one.
Who judged by a slip takes it back, and the episode awaits a judgement again: that, too, is a row more.
"""

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from typing import Any

from sqlalchemy import Connection, DateTime, Engine, func, select, update

from vsnbench.database.tables import Episode, Process
from vsnbench.errors import EpisodeClosedError, UsageError


class EpisodeState(StrEnum):
    """Where an episode stands."""

    CLAIMED = "claimed"
    """A process has taken the trial; the robot is on its way to the start."""
    PLACED = "placed"
    """The robot stands at the start, and its pose there is confirmed."""
    RUNNING = "running"
    AWAITING = "awaiting"
    """It has ended, and a person has not said yet what became of it."""
    JUDGED = "judged"
    """It is a result: a success or a failure."""
    VOID = "void"
    """It is no result: the trial must be run again."""


ACTIVE = (EpisodeState.CLAIMED, EpisodeState.PLACED, EpisodeState.RUNNING)
"""Somebody is at it: the trial is nobody else's."""
RESULTS = (EpisodeState.AWAITING, EpisodeState.JUDGED)
"""The trial is done; of several results of one trial the first counts."""
ENDED = (EpisodeState.AWAITING, EpisodeState.JUDGED, EpisodeState.VOID)

COMES_FROM: dict[EpisodeState, tuple[EpisodeState, ...]] = {
    EpisodeState.CLAIMED: (),
    EpisodeState.PLACED: (EpisodeState.CLAIMED, EpisodeState.PLACED),
    EpisodeState.RUNNING: (EpisodeState.PLACED,),
    EpisodeState.AWAITING: (EpisodeState.RUNNING, EpisodeState.JUDGED, EpisodeState.VOID),
    EpisodeState.JUDGED: (EpisodeState.RUNNING, *ENDED),
    EpisodeState.VOID: (*ACTIVE, *ENDED),
}
"""State -> the states in which an episode may have been before."""

LEASE = timedelta(seconds=60)
"""How long a claim holds without a sign of life; `Journal.renew` is one, and a step where a part of it has passed."""


def lease(connection: Connection | Engine) -> Any:
    """Return until when a claim holds that shows a sign of life now, as a column takes it.

    On a server it is the server's clock that counts: those of two robots may be minutes apart.
    """
    if connection.dialect.name == "postgresql":
        return func.clock_timestamp(type_=DateTime(timezone=True)) + LEASE
    return datetime.now(UTC) + LEASE


def moment(connection: Connection) -> datetime:
    """Return what time it is, by the clock that leases are held against."""
    if connection.dialect.name == "postgresql":
        return connection.execute(select(func.clock_timestamp(type_=DateTime(timezone=True)))).scalar_one()
    return datetime.now(UTC)


def advance(
    connection: Connection,
    episode_id: int,
    to: EpisodeState,
    *,
    came_from: Iterable[EpisodeState] = (),
    process_id: int | None = None,
    **values: Any,
) -> None:
    """Move an episode to a state, with what else is known by then.

    Args:
        connection: a transaction that may write.
        episode_id: the episode's number.
        to: its new state; the same again where `COMES_FROM` allows that.
        came_from: fewer states than `COMES_FROM` allows.
        process_id: only when this process has claimed it.
        values: other columns.

    Raises:
        UsageError: there is no such episode.
        EpisodeClosedError: it is in a state that does not lead there, or another process has it.
    """
    before = tuple(came_from) or COMES_FROM[to]
    wanted = [Episode.id == episode_id, Episode.state.in_([state.value for state in before])]
    if process_id is not None:
        wanted.append(Episode.process_id == process_id)
    if to in ENDED:
        values["lease_until"] = None
    moved = connection.execute(update(Episode).where(*wanted).values(state=to.value, **values))
    if moved.rowcount != 1:
        raise _refusal(connection, episode_id, to)


def _refusal(connection: Connection, episode_id: int, to: EpisodeState) -> EpisodeClosedError | UsageError:
    found = connection.execute(
        select(Episode.state, Episode.end_reason, Process.pid, Process.host)
        .join(Process, Process.id == Episode.process_id)
        .where(Episode.id == episode_id)
    ).first()
    if found is None:
        return UsageError(f"there is no episode {episode_id}", advice="`vsnbench episodes list` shows them")
    state = EpisodeState(found.state)
    if state in ACTIVE:
        where = f"it is {state} by process {found.pid} on {found.host}"
        if to in (EpisodeState.JUDGED, EpisodeState.VOID):
            return EpisodeClosedError(
                f"episode {episode_id} cannot be judged yet: {where}", advice="judge it when it has ended"
            )
        return EpisodeClosedError(f"episode {episode_id} is not here to go on with: {where}")
    return EpisodeClosedError(
        f"episode {episode_id} has ended already ({found.end_reason}, {state}): its end was written by another "
        "process, which took this one for dead; nothing was added to it"
    )
