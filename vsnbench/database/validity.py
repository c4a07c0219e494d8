"""Which episodes count, as SQL that every query shares: the latest verdict stands, void attempts never count.

An episode is a result when it ended with `stop`, `step_limit` or `collision` and no later verdict made it void; one
that awaits a verdict is a result that is not judged yet. Of several results of one trial the first counts.
"""

from sqlalchemy import ColumnElement, Select, and_, exists, func, or_, select
from sqlalchemy.orm import InstrumentedAttribute, aliased

from vsnbench.database.tables import Episode, Verdict
from vsnbench.protocol.judge import EndReason

RESULTS = tuple(reason.value for reason in EndReason if reason.is_result)


def standing_verdict_id(episode_id: InstrumentedAttribute[int]) -> ColumnElement[int | None]:
    """Return the id of the episode's latest verdict as a scalar subquery."""
    verdict = aliased(Verdict)
    return select(func.max(verdict.id)).where(verdict.episode_id == episode_id).scalar_subquery()


def is_result(episode: type[Episode], verdict: type[Verdict]) -> ColumnElement[bool]:
    """Return the condition for a result, given the episode outer-joined with its standing verdict."""
    return and_(
        episode.end_reason.is_not(None),
        or_(
            and_(verdict.id.is_(None), episode.end_reason.in_(RESULTS)),
            and_(verdict.id.is_not(None), verdict.success.is_not(None)),
        ),
    )


def takers(trial_id: InstrumentedAttribute[int] | int) -> Select[int, str | None]:
    """Select id and end reason of the episodes that run, or have done, a trial."""
    episode, verdict = aliased(Episode), aliased(Verdict)
    return (
        select(episode.id, episode.end_reason)
        .outerjoin(verdict, verdict.id == standing_verdict_id(episode.id))
        .where(episode.trial_id == trial_id, or_(episode.end_reason.is_(None), is_result(episode, verdict)))
        .order_by(episode.id)
    )


def counts(episode: type[Episode], verdict: type[Verdict]) -> ColumnElement[bool]:
    """Return the condition for the one episode of its trial that counts: a result, and the first of them."""
    earlier, its_verdict = aliased(Episode), aliased(Verdict)
    before = (
        select(earlier.id)
        .outerjoin(its_verdict, its_verdict.id == standing_verdict_id(earlier.id))
        .where(earlier.trial_id == episode.trial_id, earlier.id < episode.id, is_result(earlier, its_verdict))
    )
    return and_(is_result(episode, verdict), ~exists(before.correlate(episode).subquery()))
