"""How an episode ends and is judged, within a transaction: at once, as a proposal, or later by a person."""

from sqlalchemy import Connection, insert

from vsnbench.database.episode_entries import EpisodeEnd
from vsnbench.database.lifecycle import ACTIVE, ENDED, EpisodeState, advance
from vsnbench.database.row_encoding import episode_end_row, verdict_row
from vsnbench.database.tables import Verdict as VerdictTable
from vsnbench.protocol.judge import Verdict


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


def judge(
    connection: Connection, episode_id: int, verdict: Verdict, *, author: str, source: str, note: str = ""
) -> None:
    """Append a judgement within a transaction; see `Journal.judge`."""
    state = EpisodeState.VOID if verdict.success is None else EpisodeState.JUDGED
    advance(connection, episode_id, state, came_from=ENDED)
    row = verdict_row(episode_id, verdict, author=author, source=source, note=note)
    connection.execute(insert(VerdictTable), row)
