"""Shared columns and selections of queries: current verdict, outcome, whether an episode counts, names while blind.

The current verdict is the latest judgement, never a proposal. The first result of a trial counts once it is judged.
Reports, lists, export and replay all select through `episodes_of_trials` or `episodes_of_campaigns`. Arms of a blinded
study are shown as codes: every query of a model's or campaign's name uses `MODEL_NAME` and `CAMPAIGN_NAME`.
"""

from typing import Any

from sqlalchemy import BindParameter, ColumnElement, Select, Text, case, cast, exists, func, literal, select
from sqlalchemy.orm import InstrumentedAttribute, aliased

from vsnbench.protocol.judge import MODEL_FAILURES, EndReason
from vsnbench.results.schema.study_tables import Study, StudyArm
from vsnbench.results.schema.tables import (
    CampaignRow,
    EpisodeRow,
    GoalRow,
    ModelRow,
    RobotRow,
    SiteRow,
    TrialRow,
    VerdictRow,
)
from vsnbench.results.writing.lifecycle import ACTIVE, RESULTS, EpisodeState


def _code(campaign_id: InstrumentedAttribute[int]) -> Any:
    return (
        select(literal("study").concat(cast(Study.id, Text)).concat("-").concat(StudyArm.code))
        .select_from(StudyArm)
        .join(Study, Study.id == StudyArm.study_id)
        .where(StudyArm.campaign_id == campaign_id, Study.blind.is_(True), Study.unblinded_at.is_(None))
    )


CODE: ColumnElement[str | None] = _code(CampaignRow.id).correlate(CampaignRow).scalar_subquery()
"""Code of a campaign that is an arm of a blinded study; NULL for others."""
MODEL_NAME: ColumnElement[str] = func.coalesce(CODE, ModelRow.name)
CAMPAIGN_NAME: ColumnElement[str] = func.coalesce(CODE, CampaignRow.name)
CAMPAIGN_KEY: ColumnElement[str] = func.coalesce(CODE, CampaignRow.key)
HAS_HIDDEN_DURATION: ColumnElement[bool] = CampaignRow.protocol["execution"].as_string().is_not(None) & CODE.is_not(
    None
)
"""The duration of an episode on the robot's clock would reveal how long the model of a blinded arm thinks."""
HIDDEN = "hidden while the study is blinded"
"""Replacement of texts that could identify a model."""
TELLING = frozenset(reason.value for reason in MODEL_FAILURES)
"""End reasons and event kinds with texts from the model."""
ERROR: ColumnElement[str] = case(
    (CODE.is_not(None) & (EpisodeRow.error != "") & EpisodeRow.end_reason.in_(sorted(TELLING)), HIDDEN),
    else_=EpisodeRow.error,
)


def current_verdict_id(episode_id: InstrumentedAttribute[int]) -> ColumnElement[int | None]:
    """Return the id of the episode's latest judgement as a scalar subquery."""
    verdict = aliased(VerdictRow)
    return (
        select(func.max(verdict.id))
        .where(verdict.episode_id == episode_id, verdict.proposed.is_(False))
        .scalar_subquery()
    )


STANDS: ColumnElement[bool] = EpisodeRow.state != EpisodeState.AWAITING.value
"""The latest judgement is current: an episode with a retracted judgement awaits another."""
END_REASON: ColumnElement[str | None] = func.coalesce(VerdictRow.end_reason, EpisodeRow.end_reason)
SUCCESS: ColumnElement[bool | None] = VerdictRow.success.expression
"""None unless judged."""
DISTANCE_M: ColumnElement[float | None] = func.coalesce(VerdictRow.distance_m, EpisodeRow.distance_to_goal_m)
GOAL_IN_SIGHT: ColumnElement[bool] = func.coalesce(VerdictRow.goal_in_sight, EpisodeRow.goal_in_sight, True)
"""True if the rule did not require it: before version 2 of the protocol."""
DISTANCE_SOURCE: ColumnElement[str | None] = func.coalesce(VerdictRow.distance_source, EpisodeRow.distance_source)
GOAL_INSTANCE: ColumnElement[str | None] = func.coalesce(VerdictRow.goal_instance, EpisodeRow.goal_instance)
COLLISION: ColumnElement[bool] = func.coalesce(EndReason.COLLISION.value == END_REASON, False)


def _is_first_result() -> ColumnElement[bool]:
    earlier = aliased(EpisodeRow)
    before = select(earlier.id).where(
        earlier.trial_id == EpisodeRow.trial_id, earlier.id < EpisodeRow.id, earlier.state.in_(_values(RESULTS))
    )
    return ~exists(before.correlate(EpisodeRow).subquery())


def _values(states: tuple[EpisodeState, ...]) -> list[str]:
    return [state.value for state in states]


COUNTED, UNJUDGED, VOID, SUPERSEDED, RUNNING = "counted", "unjudged", "void", "superseded", "running"
"""Roles of an episode in a report: the result that counts; a result without verdict; void; a further result of the
trial; not ended."""

COUNTS: ColumnElement[bool] = (EpisodeRow.state == EpisodeState.JUDGED.value) & _is_first_result()
"""The episode is the first result of its trial, and is judged: the only definition of what counts."""
OUTCOME: ColumnElement[str] = case(
    (EpisodeRow.state.in_(_values(ACTIVE)), "running"),
    (EpisodeRow.state == EpisodeState.VOID.value, "void"),
    (EpisodeRow.state == EpisodeState.AWAITING.value, "unjudged"),
    (SUCCESS, "success"),
    else_="failure",
)
"""Outcome according to the current verdict."""
PART: ColumnElement[str] = case(
    (COUNTS, COUNTED),
    (EpisodeRow.state.in_(_values(ACTIVE)), RUNNING),
    (EpisodeRow.state == EpisodeState.VOID.value, VOID),
    (~_is_first_result(), SUPERSEDED),
    else_=UNJUDGED,
)
"""One of `COUNTED`, `UNJUDGED`, `VOID`, `SUPERSEDED`, `RUNNING`."""


def episodes_of_trials(*columns: Any) -> Select[Any]:
    """Select columns of Episode, Trial and the current Verdict for all episodes, unordered."""
    return (
        select(*columns)
        .select_from(EpisodeRow)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .outerjoin(VerdictRow, (VerdictRow.id == current_verdict_id(EpisodeRow.id)) & STANDS)
    )


def episodes_of_campaigns(*columns: Any) -> Select[Any]:
    """Select columns of Episode, Trial, the current Verdict, Campaign, Model, Robot, Site and Goal."""
    return (
        episodes_of_trials(*columns)
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .join(ModelRow, ModelRow.id == CampaignRow.model_id)
        .join(RobotRow, RobotRow.id == CampaignRow.robot_id)
        .join(SiteRow, SiteRow.id == CampaignRow.site_id)
        .outerjoin(GoalRow, GoalRow.id == TrialRow.goal_id)
    )


def episodes_with(*columns: Any) -> Select[Any]:
    """Select columns for all episodes, unordered; the tables of the campaign are only joined if a column needs them."""
    needed = set(select(*columns).get_final_froms())
    is_of_trials = needed <= {row.__table__ for row in (EpisodeRow, TrialRow, VerdictRow)}
    return (episodes_of_trials if is_of_trials else episodes_of_campaigns)(*columns)


def first_attempt(trial_id: InstrumentedAttribute[int]) -> ColumnElement[int | None]:
    """Return the id of the first episode of a trial that is not void, as a scalar subquery."""
    episode = aliased(EpisodeRow)
    return (
        select(func.min(episode.id))
        .where(episode.trial_id == trial_id, episode.state != EpisodeState.VOID.value)
        .correlate(trial_id.class_)
        .scalar_subquery()
    )


def episodes_holding_trial(trial_id: InstrumentedAttribute[int] | BindParameter[Any]) -> Select[int, str]:
    """Select id and state of the active episodes and results of a trial."""
    episode = aliased(EpisodeRow)
    return (
        select(episode.id, episode.state)
        .where(episode.trial_id == trial_id, episode.state != EpisodeState.VOID.value)
        .order_by(episode.id)
    )
