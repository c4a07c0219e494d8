"""States of an episode and their transitions.

    claimed -> placed -> running -> awaiting judgement -> judged
                                                       -> void

A trial is claimed before the operator moves the robot to its start. The episode is placed when its start pose is
confirmed, and runs until it ends. Results that the protocol can decide are judged immediately. Others (real robots,
imported logs) await an operator's judgement and do not count before. A later verdict may void a judged episode or judge
a void one; earlier verdicts are kept. A retracted judgement leaves the episode awaiting another, and stays recorded.
"""

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from functools import lru_cache
from typing import Any, cast

from sqlalchemy import ClauseElement, Connection, DateTime, Dialect, Table, Update, bindparam, func, select, update

from vsnbench.errors import EpisodeClosedError, UsageError
from vsnbench.results.schema.tables import EpisodeRow, ProcessRow


class EpisodeState(StrEnum):
    """State of an episode."""

    CLAIMED = "claimed"
    """A process has claimed the trial; the robot moves to the start."""
    PLACED = "placed"
    """The robot is at the start, with a confirmed pose."""
    RUNNING = "running"
    AWAITING = "awaiting"
    """The episode has ended and awaits an operator's judgement."""
    JUDGED = "judged"
    """The episode is a success or a failure."""
    VOID = "void"
    """The episode has no result: the trial must be repeated."""


ACTIVE = (EpisodeState.CLAIMED, EpisodeState.PLACED, EpisodeState.RUNNING)
"""A process is running the trial."""
RESULTS = (EpisodeState.AWAITING, EpisodeState.JUDGED)
"""The trial has a result; of several results the first counts."""
ENDED = (EpisodeState.AWAITING, EpisodeState.JUDGED, EpisodeState.VOID)

PREVIOUS_STATES: dict[EpisodeState, tuple[EpisodeState, ...]] = {
    EpisodeState.CLAIMED: (),
    EpisodeState.PLACED: (EpisodeState.CLAIMED, EpisodeState.PLACED),
    EpisodeState.RUNNING: (EpisodeState.PLACED,),
    EpisodeState.AWAITING: (EpisodeState.RUNNING, EpisodeState.JUDGED, EpisodeState.VOID),
    EpisodeState.JUDGED: (EpisodeState.RUNNING, *ENDED),
    EpisodeState.VOID: (*ACTIVE, *ENDED),
}
"""State -> allowed previous states."""

LEASE = timedelta(seconds=60)
"""Time for which a claim holds without renewal; `Journal.renew` and, after a part of the time, steps renew it."""


def lease(dialect: Dialect) -> Any:
    """Return the value of a lease renewed now.

    On a server its own clock is used, because the clocks of two robots may differ by minutes.
    """
    return _SERVERS_LEASE if dialect.name == "postgresql" else datetime.now(UTC) + LEASE


_SERVERS_LEASE = func.clock_timestamp(type_=DateTime(timezone=True)) + LEASE


def moment(connection: Connection) -> datetime:
    """Return the current time of the clock used for leases."""
    if connection.dialect.name == "postgresql":
        return connection.execute(select(func.clock_timestamp(type_=DateTime(timezone=True)))).scalar_one()
    return datetime.now(UTC)


def advance(
    connection: Connection,
    episode_id: int,
    to: EpisodeState,
    *,
    from_states: Iterable[EpisodeState] = (),
    process_id: int | None = None,
    **values: Any,
) -> None:
    """Move an episode to another state and set further columns.

    Args:
        connection: a transaction that may write.
        episode_id: number of the episode.
        to: the new state; may be the current one if `PREVIOUS_STATES` allows it.
        from_states: restricts the allowed previous states.
        process_id: process that must have claimed the episode.
        values: other columns.

    Raises:
        UsageError: the episode does not exist.
        EpisodeClosedError: the transition is not allowed, or another process has the episode.
    """
    before = tuple(from_states) or PREVIOUS_STATES[to]
    values["state"] = to.value
    if to in ENDED:
        values["lease_until"] = None
    computed = {name: value for name, value in values.items() if isinstance(value, ClauseElement)}
    given = {name: value for name, value in values.items() if name not in computed}
    statement = _transition(before, tuple(given), tuple(computed.items()), owned=process_id is not None)
    parameters = {"episode": episode_id, **{f"new_{name}": value for name, value in given.items()}}
    if process_id is not None:
        parameters["process"] = process_id
    moved = connection.execute(statement, parameters)
    if moved.rowcount != 1:
        raise _refusal(connection, episode_id, to)


@lru_cache(maxsize=64)
def _transition(
    before: tuple[EpisodeState, ...], given: tuple[str, ...], computed: tuple[tuple[str, Any], ...], *, owned: bool
) -> Update:
    """Return the statement that sets columns of an episode in one of some states.

    It is kept, because making it takes longer than executing it. Its parameters are `episode`, the values as
    `new_COLUMN`, and if it must have claimed the episode `process`. SQL expressions are part of the statement.
    """
    table = cast("Table", EpisodeRow.__table__)
    wanted = [table.c.id == bindparam("episode"), table.c.state.in_([state.value for state in before])]
    if owned:
        wanted.append(table.c.process_id == bindparam("process"))
    values: dict[str, Any] = {name: bindparam(f"new_{name}") for name in given}
    return update(table).where(*wanted).values({**values, **dict(computed)})


def _refusal(connection: Connection, episode_id: int, to: EpisodeState) -> EpisodeClosedError | UsageError:
    found = connection.execute(
        select(EpisodeRow.state, EpisodeRow.end_reason, ProcessRow.pid, ProcessRow.host)
        .join(ProcessRow, ProcessRow.id == EpisodeRow.process_id)
        .where(EpisodeRow.id == episode_id)
    ).first()
    if found is None:
        return UsageError(f"episode {episode_id} does not exist", advice="`vsnbench episodes list` lists the episodes")
    state = EpisodeState(found.state)
    if state in ACTIVE:
        where = f"it is {state} by process {found.pid} on {found.host}"
        if to in (EpisodeState.JUDGED, EpisodeState.VOID):
            return EpisodeClosedError(
                f"episode {episode_id} cannot be judged yet: {where}", advice="judge it when it has ended"
            )
        return EpisodeClosedError(f"episode {episode_id} cannot be continued in this process: {where}")
    return EpisodeClosedError(
        f"episode {episode_id} has already ended ({found.end_reason}, {state}): another process wrote its end, because "
        "it considered this process dead; nothing was added"
    )
