"""Judgements of an episode by several people: checks for newer verdicts, and retraction."""

from sqlalchemy import Connection, Engine, insert, select

from vsnbench.errors import JudgedMeanwhileError, UsageError
from vsnbench.protocol.judge import Verdict
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.row_encoding import verdict_row
from vsnbench.results.schema.tables import EpisodeRow, VerdictRow
from vsnbench.results.studies.log import log_outcome
from vsnbench.results.writing.lifecycle import ENDED, EpisodeState, advance

RETRACTED = "taken_back"
"""Kind of events for a retracted judgement."""


def require_unchanged_judgement(connection: Connection, episode_id: int, seen: int) -> None:
    """Check, with the episode's row locked, that its verdicts are those that the author saw.

    Raises:
        JudgedMeanwhileError: there are newer verdicts.
    """
    query = select(VerdictRow.author, VerdictRow.reason).where(VerdictRow.episode_id == episode_id)
    found = connection.execute(query.order_by(VerdictRow.id)).all()
    if len(found) != seen:
        last = found[-1] if found else None
        latest = f"{last.author} judged it meanwhile: {last.reason}" if last else "it has no verdict"
        raise JudgedMeanwhileError(f"#{episode_id}: {latest}", advice="check the episode, then judge it again")


def judge(
    connection: Connection,
    episode_id: int,
    verdict: Verdict,
    *,
    author: str,
    source: str,
    note: str = "",
    seen: int | None = None,
) -> None:
    """Append a judgement within a transaction; see `Journal.judge`."""
    state = EpisodeState.VOID if verdict.success is None else EpisodeState.JUDGED
    advance(connection, episode_id, state, from_states=ENDED)
    if seen is not None:
        require_unchanged_judgement(connection, episode_id, seen)
    row = verdict_row(episode_id, verdict, author=author, source=source, note=note)
    connection.execute(insert(VerdictRow), row)
    log_outcome(connection, episode_id)


def trial_of(engine: Engine, episode_id: int) -> int:
    """Return the trial number of an episode.

    Raises:
        UsageError: the episode does not exist.
        RecordError: the database cannot be read.
    """
    with transaction(reading(engine)) as connection:
        found = connection.scalar(select(EpisodeRow.trial_id).where(EpisodeRow.id == episode_id))
    if found is None:
        raise UsageError(f"episode {episode_id} does not exist", advice="`vsnbench episodes list` lists the episodes")
    return int(found)
