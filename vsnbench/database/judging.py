"""Judgements of an episode by several people: nobody judges what they have not seen, and a slip is taken back."""

from sqlalchemy import Connection, Engine, insert, select

from vsnbench.database.engine import reading, transaction
from vsnbench.database.lifecycle import ENDED, EpisodeState, advance
from vsnbench.database.row_encoding import verdict_row
from vsnbench.database.tables import Episode
from vsnbench.database.tables import Verdict as VerdictTable
from vsnbench.errors import JudgedMeanwhileError, UsageError
from vsnbench.protocol.judge import Verdict

TAKEN_BACK = "taken_back"
"""Kind of the events that say that a judgement was a slip, and who says so."""


def see_that_nobody_judged(connection: Connection, episode_id: int, seen: int) -> None:
    """See, once the episode's row is ours, that its verdicts are those that were looked at.

    Raises:
        JudgedMeanwhileError: they are not.
    """
    query = select(VerdictTable.author, VerdictTable.reason).where(VerdictTable.episode_id == episode_id)
    found = connection.execute(query.order_by(VerdictTable.id)).all()
    if len(found) != seen:
        last = found[-1] if found else None
        said = f"{last.author} said meanwhile: {last.reason}" if last else "it has no verdict"
        raise JudgedMeanwhileError(f"#{episode_id}: {said}", advice="look again, then say what you think")


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
    advance(connection, episode_id, state, came_from=ENDED)
    if seen is not None:
        see_that_nobody_judged(connection, episode_id, seen)
    row = verdict_row(episode_id, verdict, author=author, source=source, note=note)
    connection.execute(insert(VerdictTable), row)


def trial_of(engine: Engine, episode_id: int) -> int:
    """Return the number of the trial that an episode is an attempt at.

    Raises:
        UsageError: there is no such episode.
        RecordError: the database cannot be read.
    """
    with transaction(reading(engine)) as connection:
        found = connection.scalar(select(Episode.trial_id).where(Episode.id == episode_id))
    if found is None:
        raise UsageError(f"there is no episode {episode_id}", advice="`vsnbench episodes list` shows them")
    return int(found)
