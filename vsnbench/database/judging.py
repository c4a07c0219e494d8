"""Judgements of an episode by several people: nobody judges what they have not seen, and a slip is taken back."""

from sqlalchemy import Connection, select

from vsnbench.database.tables import Verdict as VerdictTable
from vsnbench.errors import JudgedMeanwhileError

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
