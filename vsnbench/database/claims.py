"""Who is at a trial: claims, placings and beginnings, each a step of an episode's life within a transaction."""

import uuid
from collections.abc import Collection, Sequence
from datetime import UTC, datetime

from sqlalchemy import Connection, bindparam, delete, insert, select, update

from vsnbench.database.campaign_plan import Trial as KnownTrial
from vsnbench.database.campaign_plan import trial_seed
from vsnbench.database.episode_entries import Claim, EpisodeBegin
from vsnbench.database.insertion import insert_row
from vsnbench.database.lifecycle import EpisodeState, advance, lease
from vsnbench.database.read_model import takers
from vsnbench.database.row_encoding import episode_begin_row, placement_row, step_row
from vsnbench.database.tables import Campaign, Episode, Event, Step, Trial
from vsnbench.errors import EpisodeClosedError
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.step_record import StepRecord

UNBEGUN = (EpisodeState.CLAIMED, EpisodeState.PLACED)


def images_directory(episode_id: int) -> str:
    """Return where an episode's files lie, relative to the results directory."""
    return f"episodes/{episode_id:06d}"


def claim_first(
    connection: Connection, process_id: int, campaign_id: int, trial_ids: Sequence[int], origin: str = "run"
) -> Claim | None:
    """Claim the first of these trials that is left, and that nobody else is claiming right now."""
    # Whoever asks for one trial alone is not told of thousands of others first.
    free = _free(connection, campaign_id) if len(trial_ids) > 1 else trial_ids
    for trial_id in trial_ids:
        if trial_id not in free:
            continue
        # On a server this row is the lock by which two robots do not take the same trial; what another one is
        # looking at this very moment is passed over instead of waited for.
        row = connection.execute(
            select(Trial.id, Trial.goal, Trial.start, Trial.repetition, Campaign.seed)
            .join(Campaign, Campaign.id == Trial.campaign_id)
            .where(Trial.id == trial_id)
            .with_for_update(of=Trial, skip_locked=True)
        ).first()
        if row is None or connection.execute(_TAKEN, {"trial": trial_id}).first() is not None:
            continue
        trial = KnownTrial(row.id, campaign_id, row.goal, row.start, row.repetition)
        return _claim(connection, process_id, trial, trial_seed(row.seed, row.goal, row.start, row.repetition), origin)
    return None


_TAKEN = takers(bindparam("trial")).limit(1)


def _free(connection: Connection, campaign_id: int) -> Collection[int]:
    left = select(Trial.id).where(Trial.campaign_id == campaign_id, ~takers(Trial.id).correlate(Trial).exists())
    return set(connection.scalars(left))


def _claim(connection: Connection, process_id: int, trial: KnownTrial, seed: int, origin: str) -> Claim:
    identity = str(uuid.uuid4())
    episode_id = insert_row(
        connection,
        Episode,
        {
            "uuid": identity,
            "trial_id": trial.id,
            "process_id": process_id,
            "origin": origin,
            "state": EpisodeState.CLAIMED.value,
            "seed": seed,
            "started_at": datetime.now(UTC),
            "error": "",
            "actions": 0,
            "images_directory": "",
        },
    )
    directory = images_directory(episode_id)
    held = {"images_directory": directory, "lease_until": lease(connection)}
    connection.execute(update(Episode).where(Episode.id == episode_id).values(held))
    return Claim(episode_id, identity, trial, seed, directory)


def place(connection: Connection, process_id: int, episode_id: int, start: Fix) -> None:
    """Write down where the robot stands, and how that is known; it may be said again until the episode begins."""
    values = {**placement_row(start), "lease_until": lease(connection)}
    advance(connection, episode_id, EpisodeState.PLACED, process_id=process_id, **values)


def begin(connection: Connection, process_id: int, episode_id: int, entry: EpisodeBegin) -> None:
    """Let a placed episode run."""
    values = {**episode_begin_row(entry), "lease_until": lease(connection)}
    advance(connection, episode_id, EpisodeState.RUNNING, process_id=process_id, **values)


def release(connection: Connection, episode_id: int) -> bool:
    """Forget a claim that never began; its trial is left as if nobody had taken it. False when it has begun."""
    unbegun = [Episode.id == episode_id, Episode.state.in_([state.value for state in UNBEGUN])]
    if connection.execute(select(Episode.id).where(*unbegun).with_for_update()).first() is None:
        return False
    connection.execute(delete(Event).where(Event.episode_id == episode_id))
    return connection.execute(delete(Episode).where(*unbegun)).rowcount == 1


def renew(connection: Connection, process_id: int, episode_id: int) -> bool:
    """Show a sign of life for a claim; False when it is this process's no more."""
    found = connection.execute(
        _MINE.values(lease_until=lease(connection)), {"episode": episode_id, "process": process_id}
    )
    return found.rowcount == 1


_MINE = update(Episode).where(
    Episode.id == bindparam("episode"), Episode.process_id == bindparam("process"), Episode.end_reason.is_(None)
)
_MINE_RUNNING = _MINE.where(Episode.state == EpisodeState.RUNNING.value)
_INSERT_STEP = insert(Step)


def append_step(connection: Connection, process_id: int, episode_id: int, step: StepRecord) -> None:
    """Write a step of an episode that runs here; every step is a sign of life.

    Raises:
        EpisodeClosedError: it does not run here.
    """
    row = step_row(episode_id, step)
    mine = connection.execute(
        _MINE_RUNNING.values(lease_until=lease(connection)), {"episode": episode_id, "process": process_id}
    )
    if mine.rowcount != 1:
        raise EpisodeClosedError(
            f"episode {episode_id} does not run here (any more), so its step {step.number} was not recorded: another "
            "process took this one for dead, or it has ended"
        )
    connection.execute(_INSERT_STEP, row)
