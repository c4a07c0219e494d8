"""An episode as it is written: claimed, placed, begun, its steps, its end and judgements."""

import uuid
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property

from sqlalchemy import Connection, Engine, bindparam, delete, insert, select, update

from vsnbench.database.campaign_plan import Trial as KnownTrial
from vsnbench.database.campaign_plan import trial_seed
from vsnbench.database.engine import transaction
from vsnbench.database.episode_entries import EpisodeBegin, EpisodeEnd
from vsnbench.database.judging import TAKEN_BACK, judge, see_that_nobody_judged
from vsnbench.database.lifecycle import ACTIVE, EpisodeState, advance, lease
from vsnbench.database.placement_tables import Placement
from vsnbench.database.read_model import takers
from vsnbench.database.row_encoding import (
    episode_begin_row,
    episode_end_row,
    insert_row,
    measured_row,
    placement_row,
    text,
    verdict_row,
)
from vsnbench.database.sessions import operator_of
from vsnbench.database.step_rows import StepStatements, step_row
from vsnbench.database.tables import Campaign, Episode, Event, Trial
from vsnbench.database.tables import Verdict as VerdictTable
from vsnbench.errors import EpisodeClosedError
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.judge import Verdict
from vsnbench.protocol.step_record import StepRecord

UNBEGUN = (EpisodeState.CLAIMED, EpisodeState.PLACED)


@dataclass(frozen=True, slots=True)
class Claim:
    """An episode that this process has taken: nobody else runs its trial until it is released, voided or ended."""

    id: int
    """The episode's number."""
    uuid: str
    trial: KnownTrial
    seed: int
    images_directory: str
    """Relative to the results directory; empty when no images are kept."""


class EpisodeWriter:
    """What an open record writes of an episode; every method commits before it returns."""

    engine: Engine
    _process_id: int

    @cached_property
    def _steps(self) -> StepStatements:
        return StepStatements(self.engine)

    def claim_next(self, campaign_id: int, trial_ids: Sequence[int]) -> Claim | None:
        """Take the first of these trials that is left, before anybody is asked to wheel a robot to its mark.

        No other process runs it until the claim is released, voided or ended, or this process is taken for dead:
        `renew` it while a person takes long. None when all of them are done or are run elsewhere.
        """
        with transaction(self.engine) as connection:
            return claim_first(connection, self._process_id, campaign_id, trial_ids)

    def renew(self, episode_id: int) -> bool:
        """Show a sign of life for a claim; False when it is this process's no more."""
        with transaction(self.engine) as connection:
            mine = _MINE.values(lease_until=lease(connection))
            found = connection.execute(mine, {"episode": episode_id, "process": self._process_id})
        return found.rowcount == 1

    def place(self, episode_id: int, start: Fix) -> None:
        """Write down where the robot of a claimed episode stands, and how that is known; until it begins, again.

        Raises:
            EpisodeClosedError: the claim is this process's no more, or the episode has begun.
        """
        with transaction(self.engine) as connection:
            row = {**placement_row(start), "lease_until": lease(connection)}
            advance(connection, episode_id, EpisodeState.PLACED, process_id=self._process_id, **row)

    def begin(self, episode_id: int, entry: EpisodeBegin) -> None:
        """Let a placed episode run.

        Raises:
            EpisodeClosedError: it is not placed, or this process's no more.
        """
        with transaction(self.engine) as connection:
            row = {**episode_begin_row(entry), "lease_until": lease(connection)}
            advance(connection, episode_id, EpisodeState.RUNNING, process_id=self._process_id, **row)
            if entry.measured is not None:
                accepted = measured_row(episode_id, entry.measured, operator_of(connection, episode_id))
                connection.execute(insert(Placement), accepted)

    def release(self, episode_id: int) -> bool:
        """Give back a claim that never began, without a trace; False when it has begun or is gone."""
        with transaction(self.engine) as connection:
            return release(connection, episode_id)

    def append_step(self, episode_id: int, step: StepRecord) -> None:
        """Write one step. Its images must be on disk before: then a committed step always has them.

        Raises:
            EpisodeClosedError: the episode does not run here: another process took this one for dead.
        """
        if not self._steps.append(self._process_id, step_row(episode_id, step)):
            raise EpisodeClosedError(
                f"episode {episode_id} does not run here (any more), so its step {step.number} was not recorded: "
                "another process took this one for dead, or it has ended"
            )

    def end_episode(self, episode_id: int, end: EpisodeEnd) -> None:
        """Write an episode's end and the protocol's verdict or proposal, both or neither.

        A void end may come before the episode has begun: so an attempt that cannot begin says why.

        Raises:
            EpisodeClosedError: it has ended already, for instance because another process took this one for dead.
        """
        with transaction(self.engine) as connection:
            end_episode(connection, self._process_id, episode_id, end)

    def judge(
        self,
        episode_id: int,
        verdict: Verdict,
        *,
        author: str,
        source: str = "person",
        note: str = "",
        seen: int | None = None,
    ) -> None:
        """Append a judgement to an ended episode; from now on it stands.

        Args:
            episode_id: the episode's number.
            verdict: the judgement; `success` None makes the episode void.
            author: who judges.
            source: `person`, `protocol`, `recovery` or `import`.
            note: why, in the author's own words.
            seen: how many verdicts the author saw; None for whoever does not look.

        Raises:
            UsageError: there is no such episode.
            EpisodeClosedError: it has not ended yet.
            JudgedMeanwhileError: there are others than were seen; nothing was written.
        """
        with transaction(self.engine) as connection:
            judge(connection, episode_id, verdict, author=author, source=source, note=note, seen=seen)

    def take_back(self, episode_id: int, *, author: str, seen: int) -> None:
        """Take the judgement of an episode back: it awaits another; what was said stays in the record.

        Raises:
            UsageError: there is no such episode.
            JudgedMeanwhileError: there are other verdicts than were seen; nothing was written.
        """
        with transaction(self.engine) as connection:
            advance(connection, episode_id, EpisodeState.AWAITING, came_from=(EpisodeState.JUDGED, EpisodeState.VOID))
            see_that_nobody_judged(connection, episode_id, seen)
            said = {"kind": TAKEN_BACK, "author": text(author), "text": "the judgement was a slip"}
            connection.execute(insert(Event), {**said, "episode_id": episode_id, "created_at": datetime.now(UTC)})


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


def release(connection: Connection, episode_id: int) -> bool:
    """Forget a claim that never began; its trial is left as if nobody had taken it. False when it has begun."""
    unbegun = [Episode.id == episode_id, Episode.state.in_([state.value for state in UNBEGUN])]
    if connection.execute(select(Episode.id).where(*unbegun).with_for_update()).first() is None:
        return False
    connection.execute(delete(Event).where(Event.episode_id == episode_id))
    return connection.execute(delete(Episode).where(*unbegun)).rowcount == 1


_MINE = update(Episode).where(
    Episode.id == bindparam("episode"), Episode.process_id == bindparam("process"), Episode.end_reason.is_(None)
)


def end_episode(connection: Connection, process_id: int, episode_id: int, end: EpisodeEnd) -> None:
    """Write an episode's end within a transaction; see `Journal.end_episode`."""
    verdict = end.verdict
    if verdict is None:
        state = EpisodeState.AWAITING
    elif verdict.success is None:
        state = EpisodeState.VOID
    else:
        state = EpisodeState.AWAITING if end.proposed else EpisodeState.JUDGED
    before = ACTIVE if state is EpisodeState.VOID else (EpisodeState.RUNNING,)
    advance(connection, episode_id, state, came_from=before, process_id=process_id, **episode_end_row(end))
    if verdict is not None:
        proposed = state is EpisodeState.AWAITING
        row = verdict_row(episode_id, verdict, author="vsnbench", source="protocol", proposed=proposed)
        connection.execute(insert(VerdictTable), row)
