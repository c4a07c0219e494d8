"""Writes episodes: claim, placement, beginning, steps, end and judgements."""

import uuid
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property

from sqlalchemy import Connection, Engine, bindparam, delete, insert, select, update

from vsnbench.errors import EpisodeClosedError
from vsnbench.protocol.judge import Verdict
from vsnbench.results.reading.episode_numbers import ReleasedClaim
from vsnbench.results.reading.read_model import episodes_holding_trial
from vsnbench.results.schema.engine import transaction
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.schema.row_encoding import (
    episode_begin_row,
    episode_end_row,
    event_row,
    insert_row,
    measured_row,
    pose_columns,
    stop_row,
    verdict_row,
)
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, EventRow, TrialRow, VerdictRow
from vsnbench.results.studies.log import log_outcome
from vsnbench.results.writing.campaigns import Trial as KnownTrial
from vsnbench.results.writing.campaigns import trial_seed
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.judging import RETRACTED, judge, require_unchanged_judgement
from vsnbench.results.writing.lifecycle import ACTIVE, EpisodeState, advance, lease
from vsnbench.results.writing.sessions import session_of
from vsnbench.results.writing.steps import THINKING_S, StepStatements, step_row
from vsnbench.values.fix import Fix
from vsnbench.values.step import StepRecord

PlaceFiles = Callable[[str, str], None]
"""Places the files of an episode, by its UUID, in a directory relative to the results directory, before the commit."""
NOT_STARTED = (EpisodeState.CLAIMED, EpisodeState.PLACED)


@dataclass(frozen=True, slots=True)
class Claim:
    """An episode claimed by this process; no other process runs its trial until it is released or ends."""

    id: int
    """Number of the episode."""
    uuid: str
    trial: KnownTrial
    seed: int
    images_directory: str
    """Relative to the results directory; empty without images."""


class EpisodeWriter:
    """Episode methods of a journal; every method commits before it returns."""

    engine: Engine
    _process_id: int

    @cached_property
    def _steps(self) -> StepStatements:
        return StepStatements(self.engine)

    def claim_next(self, campaign_id: int, trial_ids: Sequence[int]) -> Claim | None:
        """Claim the first open trial of these, before the operator moves the robot to its start.

        The claim holds until it is released, voided or ended, or until its lease expires: call `renew` while the
        operator is busy. None if all trials are complete or active elsewhere.
        """
        with transaction(self.engine) as connection:
            return claim_first(connection, self._process_id, campaign_id, trial_ids)

    def renew(self, episode_id: int) -> bool:
        """Renew the lease of a claim; False if the claim is lost."""
        with transaction(self.engine) as connection:
            mine = _MINE.values(lease_until=lease(connection.dialect))
            found = connection.execute(mine, {"episode": episode_id, "process": self._process_id})
        return found.rowcount == 1

    def place(self, episode_id: int, start: Fix) -> None:
        """Record the start pose of a claimed episode; may be repeated until it begins.

        Raises:
            EpisodeClosedError: the claim is lost, or the episode has begun.
        """
        with transaction(self.engine) as connection:
            row = {**pose_columns("start", start.pose), "start_source": start.source.value}
            row["lease_until"] = lease(connection.dialect)
            advance(connection, episode_id, EpisodeState.PLACED, process_id=self._process_id, **row)

    def begin(self, episode_id: int, entry: EpisodeBegin) -> None:
        """Start a placed episode.

        Raises:
            EpisodeClosedError: the episode is not placed, or the claim is lost.
        """
        with transaction(self.engine) as connection:
            row = {**episode_begin_row(entry), "lease_until": lease(connection.dialect)}
            advance(connection, episode_id, EpisodeState.RUNNING, process_id=self._process_id, **row)
            if entry.measured is not None:
                session = session_of(connection, episode_id)
                accepted = measured_row(episode_id, entry.measured, session.operator if session else "")
                insert_row(connection, Placement, accepted)

    def release(self, episode_id: int) -> bool:
        """Delete a claim that has not begun; False if it has begun or is lost."""
        with transaction(self.engine) as connection:
            return release(connection, episode_id)

    def append_step(self, episode_id: int, step: StepRecord) -> None:
        """Write one step. Its images must be on disk before, so that every committed step has them.

        Raises:
            EpisodeClosedError: the episode does not run in this process, for example after recovery by another one.
        """
        if not self._steps.append(self._process_id, step_row(episode_id, step)):
            raise EpisodeClosedError(
                f"episode {episode_id} is not running in this process, so step {step.number} was not recorded: "
                "another process recovered it, or it has ended"
            )

    def end_episode(self, episode_id: int, end: EpisodeEnd) -> None:
        """Write an episode's end together with the protocol's verdict or proposal.

        An episode that could not begin may also end as void, with the reason.

        Raises:
            EpisodeClosedError: the episode has ended, for example after recovery by another process.
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
        """Append a judgement to an ended episode; it becomes the current verdict.

        Args:
            episode_id: number of the episode.
            verdict: the judgement; with `success` None the episode becomes void.
            author: name of the judging person.
            source: `person`, `protocol`, `recovery` or `import`.
            note: reason given by the author.
            seen: number of verdicts that the author saw; None to skip the check.

        Raises:
            UsageError: the episode does not exist.
            EpisodeClosedError: the episode has not ended.
            JudgedMeanwhileError: there are newer verdicts; nothing was written.
        """
        with transaction(self.engine) as connection:
            judge(connection, episode_id, verdict, author=author, source=source, note=note, seen=seen)

    def retract_verdict(self, episode_id: int, *, author: str, seen: int) -> None:
        """Retract the judgement of an episode, which then awaits another; the old verdict stays in the record.

        Raises:
            UsageError: the episode does not exist.
            JudgedMeanwhileError: there are newer verdicts; nothing was written.
        """
        with transaction(self.engine) as connection:
            advance(connection, episode_id, EpisodeState.AWAITING, from_states=(EpisodeState.JUDGED, EpisodeState.VOID))
            require_unchanged_judgement(connection, episode_id, seen)
            event = event_row(RETRACTED, "the judgement was a slip", author=author, episode_id=episode_id)
            connection.execute(insert(EventRow), event)
            log_outcome(connection, episode_id)


def images_directory(episode_id: int) -> str:
    """Return the directory of an episode's files, relative to the results directory."""
    return f"episodes/{episode_id:06d}"


def attach_images(connection: Connection, episode_id: int) -> str:
    """Record that an episode has images, and return their directory relative to the results directory."""
    directory = images_directory(episode_id)
    connection.execute(update(EpisodeRow).where(EpisodeRow.id == episode_id).values(images_directory=directory))
    return directory


def claim_first(connection: Connection, process_id: int, campaign_id: int, trial_ids: Sequence[int]) -> Claim | None:
    """Claim the first open trial of these that no other process is claiming at the moment."""
    # The query for open trials is skipped for a single trial, because a campaign may have thousands.
    free = _free(connection, campaign_id) if len(trial_ids) > 1 else trial_ids
    for trial_id in trial_ids:
        if trial_id not in free:
            continue
        # On a server this row lock keeps two processes from claiming the same trial; locked rows are skipped
        # instead of waited for.
        row = connection.execute(_LOCKED, {"trial": trial_id}).first()
        if row is None or connection.execute(_TAKEN, {"trial": trial_id}).first() is not None:
            continue
        trial = KnownTrial(row.goal, row.start, row.repetition, id=row.id, campaign_id=campaign_id)
        return _claim(connection, process_id, trial, trial_seed(row.seed, row.goal, row.start, row.repetition))
    return None


# Statements of every episode are made once, because that takes longer than executing them.
_LOCKED = (
    select(TrialRow.id, TrialRow.goal, TrialRow.start, TrialRow.repetition, CampaignRow.seed)
    .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
    .where(TrialRow.id == bindparam("trial"))
    .with_for_update(of=TrialRow, skip_locked=True)
)
_TAKEN = episodes_holding_trial(bindparam("trial")).limit(1)


def _free(connection: Connection, campaign_id: int) -> Collection[int]:
    left = select(TrialRow.id).where(
        TrialRow.campaign_id == campaign_id, ~episodes_holding_trial(TrialRow.id).correlate(TrialRow).exists()
    )
    return set(connection.scalars(left))


def _claim(connection: Connection, process_id: int, trial: KnownTrial, seed: int) -> Claim:
    identity = str(uuid.uuid4())
    episode_id = insert_row(
        connection,
        EpisodeRow,
        {
            "uuid": identity,
            "trial_id": trial.id,
            "process_id": process_id,
            "origin": "run",
            "state": EpisodeState.CLAIMED.value,
            "seed": seed,
            "started_at": datetime.now(UTC),
            "error": "",
            "actions": 0,
            "images_directory": "",
        },
    )
    directory = images_directory(episode_id)
    advance(
        *(connection, episode_id, EpisodeState.CLAIMED),
        from_states=(EpisodeState.CLAIMED,),
        images_directory=directory,
        lease_until=lease(connection.dialect),
    )
    return Claim(episode_id, identity, trial, seed, directory)


def release(connection: Connection, episode_id: int) -> bool:
    """Delete a claim that has not begun and record its number as released; False if the episode has begun."""
    unbegun = [EpisodeRow.id == episode_id, EpisodeRow.state.in_([state.value for state in NOT_STARTED])]
    if connection.execute(select(EpisodeRow.id).where(*unbegun).with_for_update()).first() is None:
        return False
    connection.execute(delete(EventRow).where(EventRow.episode_id == episode_id))
    connection.execute(insert(ReleasedClaim), {"number": episode_id, "released_at": datetime.now(UTC)})
    return connection.execute(delete(EpisodeRow).where(*unbegun)).rowcount == 1


_MINE = update(EpisodeRow).where(
    EpisodeRow.id == bindparam("episode"),
    EpisodeRow.process_id == bindparam("process"),
    EpisodeRow.end_reason.is_(None),
)


def end_episode(connection: Connection, process_id: int, episode_id: int, end: EpisodeEnd) -> None:
    """Write an episode's end within a transaction, also to its study's log; see `Journal.end_episode`."""
    write_end(connection, process_id, episode_id, end)
    log_outcome(connection, episode_id)


def write_end(connection: Connection, process_id: int, episode_id: int, end: EpisodeEnd) -> None:
    """Write an episode's end within a transaction; `log_outcome` must follow in it."""
    verdict = end.verdict
    if end.unjudged:
        state = EpisodeState.AWAITING
    elif verdict.success is None:
        state = EpisodeState.VOID
    else:
        state = EpisodeState.AWAITING if end.proposed else EpisodeState.JUDGED
    before = ACTIVE if state is EpisodeState.VOID else (EpisodeState.RUNNING,)
    columns = {**episode_end_row(end), "thinking_s": THINKING_S}
    advance(connection, episode_id, state, from_states=before, process_id=process_id, **columns)
    if not end.unjudged:
        proposed = state is EpisodeState.AWAITING
        row = verdict_row(episode_id, verdict, author="vsnbench", source="protocol", proposed=proposed)
        insert_row(connection, VerdictRow, row)
    if end.stop is not None:
        insert_row(connection, Placement, stop_row(episode_id, end.stop))
