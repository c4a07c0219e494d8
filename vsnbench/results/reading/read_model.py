"""Shared columns and selections of queries: current verdict, outcome, and whether an episode counts.

The current verdict is the latest judgement, never a proposal. The first result of a trial counts, also while it awaits
its judgement. Reports, lists, export and replay all select through `episodes_of_trials` or `episodes_of_campaigns`.
"""

from typing import Any

from sqlalchemy import BindParameter, ColumnElement, Select, case, exists, func, select
from sqlalchemy.orm import InstrumentedAttribute, aliased

from vsnbench.protocol.judge import EndReason
from vsnbench.results.schema.tables import Campaign, Episode, Model, Robot, Site, Trial, Verdict
from vsnbench.results.writing.lifecycle import ACTIVE, RESULTS, EpisodeState


def current_verdict_id(episode_id: InstrumentedAttribute[int]) -> ColumnElement[int | None]:
    """Return the id of the episode's latest judgement as a scalar subquery."""
    verdict = aliased(Verdict)
    return (
        select(func.max(verdict.id))
        .where(verdict.episode_id == episode_id, verdict.proposed.is_(False))
        .scalar_subquery()
    )


STANDS: ColumnElement[bool] = Episode.state != EpisodeState.AWAITING.value
"""The latest judgement is current: an episode with a retracted judgement awaits another."""
END_REASON: ColumnElement[str | None] = func.coalesce(Verdict.end_reason, Episode.end_reason)
SUCCESS: ColumnElement[bool | None] = Verdict.success.expression
"""None unless judged."""
DISTANCE_M: ColumnElement[float | None] = func.coalesce(Verdict.distance_m, Episode.distance_to_goal_m)
GOAL_IN_SIGHT: ColumnElement[bool] = func.coalesce(Verdict.goal_in_sight, Episode.goal_in_sight, True)
"""True if the rule did not require it: before version 2 of the protocol."""
DISTANCE_SOURCE: ColumnElement[str | None] = func.coalesce(Verdict.distance_source, Episode.distance_source)
GOAL_INSTANCE: ColumnElement[str | None] = func.coalesce(Verdict.goal_instance, Episode.goal_instance)
COLLISION: ColumnElement[bool] = func.coalesce(EndReason.COLLISION.value == END_REASON, False)


def _is_first_result() -> ColumnElement[bool]:
    earlier = aliased(Episode)
    before = select(earlier.id).where(
        earlier.trial_id == Episode.trial_id, earlier.id < Episode.id, earlier.state.in_(_values(RESULTS))
    )
    return ~exists(before.correlate(Episode).subquery())


def _values(states: tuple[EpisodeState, ...]) -> list[str]:
    return [state.value for state in states]


COUNTED, UNJUDGED, VOID, SUPERSEDED, RUNNING = "counted", "unjudged", "void", "superseded", "running"
"""Roles of an episode in a report: the result that counts; a result without verdict; void; a further result of the
trial; not ended."""

COUNTS: ColumnElement[bool] = Episode.state.in_(_values(RESULTS)) & _is_first_result()
"""The episode is the one that counts for its trial, judged or not."""
PART: ColumnElement[str] = case(
    (Episode.state.in_(_values(ACTIVE)), RUNNING),
    (Episode.state == EpisodeState.VOID.value, VOID),
    (~_is_first_result(), SUPERSEDED),
    (Episode.state == EpisodeState.AWAITING.value, UNJUDGED),
    else_=COUNTED,
)
"""One of `COUNTED`, `UNJUDGED`, `VOID`, `SUPERSEDED`, `RUNNING`."""


def episodes_of_trials(*columns: Any) -> Select[Any]:
    """Select columns of Episode, Trial and the current Verdict for all episodes, unordered."""
    return (
        select(*columns)
        .select_from(Episode)
        .join(Trial, Trial.id == Episode.trial_id)
        .outerjoin(Verdict, (Verdict.id == current_verdict_id(Episode.id)) & STANDS)
    )


def episodes_of_campaigns(*columns: Any) -> Select[Any]:
    """Select columns of Episode, Trial, the current Verdict, Campaign, Model, Robot and Site."""
    return (
        episodes_of_trials(*columns)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .join(Model, Model.id == Campaign.model_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .join(Site, Site.id == Campaign.site_id)
    )


def first_attempt(trial_id: InstrumentedAttribute[int]) -> ColumnElement[int | None]:
    """Return the id of the first episode of a trial that is not void, as a scalar subquery."""
    episode = aliased(Episode)
    return (
        select(func.min(episode.id))
        .where(episode.trial_id == trial_id, episode.state != EpisodeState.VOID.value)
        .correlate(trial_id.class_)
        .scalar_subquery()
    )


def episodes_holding_trial(trial_id: InstrumentedAttribute[int] | BindParameter[Any]) -> Select[int, str]:
    """Select id and state of the active episodes and results of a trial."""
    episode = aliased(Episode)
    return (
        select(episode.id, episode.state)
        .where(episode.trial_id == trial_id, episode.state != EpisodeState.VOID.value)
        .order_by(episode.id)
    )
