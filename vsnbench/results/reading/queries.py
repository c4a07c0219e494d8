"""Queries of episodes, their details and steps, and of campaigns.

They raise RecordError if the database cannot be read.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from sqlalchemy import Connection, Engine, Select, func, select
from sqlalchemy.orm import aliased

from vsnbench.errors import RecordError, UsageError
from vsnbench.protocol.disturbances import text_of_conditions
from vsnbench.results.annotations import tags_of
from vsnbench.results.goals import goal_of_trial, with_goals
from vsnbench.results.reading.blinding import (
    CAMPAIGN_KEY,
    CAMPAIGN_NAME,
    ENDED_AT,
    MODEL_NAME,
    blind_episodes,
    hide_details,
    hide_steps,
)
from vsnbench.results.reading.filtering import restricted
from vsnbench.results.reading.read_model import (
    COLLISION,
    COUNTS,
    DISTANCE_M,
    DISTANCE_SOURCE,
    END_REASON,
    GOAL_INSTANCE,
    SUCCESS,
    episodes_of_campaigns,
    episodes_of_trials,
)
from vsnbench.results.reading.rows import (
    CampaignState,
    EpisodeDetails,
    EpisodeFilter,
    EpisodeProvenance,
    EpisodeSummary,
    PendingEpisode,
    RecordedEvent,
    RecordedVerdict,
)
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.row_encoding import columns_of_fields, fix_of_columns, parts
from vsnbench.results.schema.tables import Campaign, Episode, Event, Model, Process, Robot, Site, Step, Trial, Verdict
from vsnbench.results.writing.lifecycle import RESULTS, EpisodeState
from vsnbench.results.writing.sessions import placement_of, session_of
from vsnbench.results.writing.steps import step_of_row
from vsnbench.text.sanitize import sanitize
from vsnbench.values.fix import PoseSource
from vsnbench.values.step import StepRecord


def list_episodes(engine: Engine, which: EpisodeFilter, limit: int | None = None) -> tuple[EpisodeSummary, ...]:
    """Return episodes by number; with a limit, the latest ones."""
    with transaction(reading(engine)) as connection:
        query = restricted(connection, _summary_query(), which)
        if limit is None:
            rows = connection.execute(query.order_by(Episode.id)).all()
        else:
            rows = connection.execute(query.order_by(Episode.id.desc()).limit(limit)).all()[::-1]
        return _summaries(connection, rows)


def count_episodes(engine: Engine, which: EpisodeFilter) -> int:
    """Return the number of episodes that match a filter."""
    with transaction(reading(engine)) as connection:
        query = restricted(connection, episodes_of_campaigns(func.count(Episode.id)), which)
        return int(connection.execute(query).scalar_one())


def episode_details(engine: Engine, episode_id: int) -> EpisodeDetails:
    """Return one episode with its verdicts, events and provenance.

    Raises:
        UsageError: the episode does not exist.
    """
    with transaction(reading(engine)) as connection:
        summary = _one_summary(connection, episode_id)
        episode = connection.execute(select(Episode.__table__).where(Episode.id == episode_id)).one()
        verdicts = select(*columns_of_fields(Verdict, RecordedVerdict)).where(Verdict.episode_id == episode_id)
        events = select(*columns_of_fields(Event, RecordedEvent)).where(Event.episode_id == episode_id)
        counts, goal_instance = connection.execute(
            episodes_of_trials(COUNTS, GOAL_INSTANCE).where(Episode.id == episode_id)
        ).one()
        details = EpisodeDetails(
            summary=summary,
            seed=episode.seed,
            ended_with=episode.end_reason,
            error=episode.error,
            goal_definition=goal_of_trial(connection, episode.trial_id),
            goal_instance=goal_instance,
            wall_duration_s=episode.wall_duration_s,
            placement=fix_of_columns(
                episode.start_x_m,
                episode.start_y_m,
                episode.start_heading_rad,
                episode.start_source or PoseSource.ESTIMATED.value,
            ),
            measured=placement_of(connection, episode_id),
            session=session_of(connection, episode_id),
            final=fix_of_columns(episode.final_x_m, episode.final_y_m, episode.final_heading_rad, episode.final_source),
            counts=bool(counts),
            verdicts=tuple(RecordedVerdict(*row) for row in connection.execute(verdicts.order_by(Verdict.id))),
            events=tuple(RecordedEvent(*row) for row in connection.execute(events.order_by(Event.id))),
            provenance=_provenance(connection, episode_id),
        )
        return hide_details(details) if blind_episodes(connection, [episode_id]) else details


def pending_episodes(engine: Engine) -> tuple[PendingEpisode, ...]:
    """Return the episodes that await an operator's judgement, by number."""
    proposal, any_proposal = aliased(Verdict), aliased(Verdict)
    latest = select(func.max(any_proposal.id)).where(
        any_proposal.episode_id == Episode.id, any_proposal.proposed.is_(True)
    )
    query = (
        episodes_of_campaigns(
            *(Episode.id, MODEL_NAME, Robot.name, Trial.goal, Trial.start, Trial.repetition, Episode.origin),
            *(Episode.end_reason, ENDED_AT, proposal.reason, proposal.success),
        )
        .outerjoin(proposal, proposal.id == latest.scalar_subquery())
        .where(Episode.state == EpisodeState.AWAITING.value)
        .order_by(Episode.id)
    )
    with transaction(reading(engine)) as connection:
        return tuple(PendingEpisode(*row) for row in connection.execute(query))


def episode_steps(engine: Engine, episode_id: int) -> tuple[StepRecord, ...]:
    """Return the committed steps of an episode in order; empty if it does not exist.

    Raises:
        RecordError: a step is invalid.
    """
    query = select(Step.__table__).where(Step.episode_id == episode_id).order_by(Step.number)
    with transaction(reading(engine)) as connection:
        steps = tuple(_step(row) for row in connection.execute(query))
        return hide_steps(steps) if blind_episodes(connection, [episode_id]) else steps


def _step(row: Any) -> StepRecord:
    try:
        return step_of_row(row)
    except ValueError as error:
        where = f"episode {row.episode_id}, step {row.number}"
        raise RecordError(f"{where}: {sanitize(str(error))[:80]}; the record is damaged") from error


def campaign_states(engine: Engine) -> tuple[CampaignState, ...]:
    """Return all campaigns with their progress, in order of creation."""
    planned = select(func.count()).where(Trial.campaign_id == Campaign.id).correlate(Campaign).scalar_subquery()
    done = (
        select(func.count(func.distinct(Episode.trial_id)))
        .join(Trial, Trial.id == Episode.trial_id)
        .where(Trial.campaign_id == Campaign.id, Episode.state.in_([state.value for state in RESULTS]))
        .correlate(Campaign)
        .scalar_subquery()
    )
    query = (
        select(
            Campaign.id,
            CAMPAIGN_KEY,
            CAMPAIGN_NAME,
            Campaign.created_at,
            MODEL_NAME,
            Robot.name,
            Robot.simulated,
            Site.name,
            Campaign.seed,
            planned,
            done,
            Campaign.conditions,
        )
        .join(Model, Model.id == Campaign.model_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .join(Site, Site.id == Campaign.site_id)
        .order_by(Campaign.id)
    )
    with transaction(reading(engine)) as connection:
        return tuple(
            replace(CampaignState(*row[:-1]), disturbances=text_of_conditions(row.conditions))
            for row in connection.execute(query)
        )


def images_directories(engine: Engine, uuids: Collection[str]) -> dict[str, str]:
    """Return the image directories of those of these episodes that are in the record."""
    query = select(Episode.uuid, Episode.images_directory)
    with transaction(reading(engine)) as connection:
        rows = [row for some in parts(uuids) for row in connection.execute(query.where(Episode.uuid.in_(some)))]
    return {row.uuid: row.images_directory for row in rows}


def recorded_models(engine: Engine) -> set[str]:
    """Return the names of all models with campaigns; codes for blinded arms."""
    with transaction(reading(engine)) as connection:
        return set(connection.scalars(episodes_of_campaigns(MODEL_NAME).distinct()))


def recorded_goals(engine: Engine) -> set[str]:
    """Return the goals that have trials."""
    with transaction(reading(engine)) as connection:
        return set(connection.scalars(select(Trial.goal).distinct()))


def _summary_query() -> Select[*tuple[Any, ...]]:
    """Select the columns of EpisodeSummary in order."""
    return episodes_of_campaigns(
        Episode.id,
        Episode.uuid,
        Campaign.id,
        CAMPAIGN_NAME,
        MODEL_NAME,
        Robot.name,
        Robot.simulated,
        Site.name,
        Trial.goal,
        Trial.start,
        Trial.repetition,
        Episode.origin,
        Episode.state,
        END_REASON,
        SUCCESS,
        Episode.actions,
        DISTANCE_M,
        DISTANCE_SOURCE,
        COLLISION,
        Episode.path_length_m,
        *(Episode.geodesic_start_m, Episode.geodesic_end_m),
        Episode.duration_s,
        Episode.started_at,
        ENDED_AT,
        Episode.images_directory,
        Campaign.protocol["success_distance_m"].as_float(),
        Campaign.conditions,
    )


def _one_summary(connection: Connection, episode_id: int) -> EpisodeSummary:
    row = connection.execute(_summary_query().where(Episode.id == episode_id)).first()
    if row is None:
        raise UsageError(
            f"episode {episode_id} does not exist",
            advice="`vsnbench episodes list` lists the episodes",
            code="unknown-episode",
        )
    return _summaries(connection, [row])[0]


def _summaries(connection: Connection, rows: Sequence[Any]) -> tuple[EpisodeSummary, ...]:
    tags = tags_of(connection, (row.id for row in rows))
    found = (replace(EpisodeSummary(*row[:-1]), disturbances=text_of_conditions(row.conditions)) for row in rows)
    return tuple(replace(summary, tags=tags[summary.id]) if summary.id in tags else summary for summary in found)


def _provenance(connection: Connection, episode_id: int) -> EpisodeProvenance:
    row = connection.execute(
        select(
            Process.vsnbench_version,
            Process.git_commit,
            Process.git_dirty,
            Process.host,
            Process.operator,
            Process.command,
            Process.packages,
            Process.platform,
            Model.weights_sha256,
            Model.weights_label,
            Model.files,
            Model.code,
            Model.settings,
            Robot.kind,
            Robot.profile,
            Site.sha256,
            Site.content,
            Campaign.protocol,
            Campaign.protocol_sha256,
            Campaign.conditions,
            *(Campaign.key, Campaign.seed, Campaign.id),
        )
        .select_from(Episode)
        .join(Process, Process.id == Episode.process_id)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .join(Model, Model.id == Campaign.model_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .join(Site, Site.id == Campaign.site_id)
        .where(Episode.id == episode_id)
    ).one()
    found = EpisodeProvenance(*row[:-1])
    return replace(found, site_content=with_goals(connection, found.site_content, row[-1:]))
