"""What others read from the record: listings, one episode whole, its steps, the state of campaigns."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import ColumnElement, Connection, Engine, Select, func, or_, select
from sqlalchemy.orm import aliased

from vsnbench.database.blinding import (
    CAMPAIGN_KEY,
    CAMPAIGN_NAME,
    MODEL_NAME,
    blind_episodes,
    hide_details,
    hide_steps,
)
from vsnbench.database.engine import reading, record_errors
from vsnbench.database.lifecycle import ACTIVE, RESULTS, EpisodeState
from vsnbench.database.read_model import (
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
from vsnbench.database.read_shapes import (
    CampaignState,
    EpisodeDetails,
    EpisodeFilter,
    EpisodeProvenance,
    EpisodeSummary,
    PendingEpisode,
    RecordedEvent,
    RecordedVerdict,
)
from vsnbench.database.row_encoding import fix_of_columns
from vsnbench.database.sessions import placement_of, session_of
from vsnbench.database.step_rows import step_of_row
from vsnbench.database.tables import Campaign, Episode, Event, Model, Process, Robot, Site, Step, Trial, Verdict
from vsnbench.errors import RecordError, UsageError
from vsnbench.harmless_text import harmless
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.step_record import StepRecord


def list_episodes(engine: Engine, which: EpisodeFilter, limit: int | None = None) -> tuple[EpisodeSummary, ...]:
    """Return episodes in the order of their numbers; with a limit, the latest ones.

    Raises:
        RecordError: the database cannot be read.
    """
    query = _restricted(_summary_query(), which)
    with _reader(engine) as connection:
        if limit is None:
            return tuple(EpisodeSummary(*row) for row in connection.execute(query.order_by(Episode.id)))
        rows = connection.execute(query.order_by(Episode.id.desc()).limit(limit)).all()
        return tuple(EpisodeSummary(*row) for row in reversed(rows))


def count_episodes(engine: Engine, which: EpisodeFilter) -> int:
    """Return how many episodes the filter finds.

    Raises:
        RecordError: the database cannot be read.
    """
    query = _restricted(episodes_of_campaigns(func.count(Episode.id)), which)
    with _reader(engine) as connection:
        return int(connection.execute(query).scalar_one())


def episode_details(engine: Engine, episode_id: int) -> EpisodeDetails:
    """Return one episode with its verdicts, events and provenance.

    Raises:
        UsageError: there is no such episode.
        RecordError: the database cannot be read.
    """
    with _reader(engine) as connection:
        summary = _one_summary(connection, episode_id)
        episode = connection.execute(select(Episode.__table__).where(Episode.id == episode_id)).one()
        verdicts = connection.execute(
            select(
                Verdict.created_at,
                Verdict.proposed,
                Verdict.success,
                Verdict.end_reason,
                Verdict.distance_m,
                Verdict.distance_source,
                Verdict.goal_instance,
                Verdict.goal_in_sight,
                Verdict.author,
                Verdict.source,
                Verdict.reason,
                Verdict.note,
            )
            .where(Verdict.episode_id == episode_id)
            .order_by(Verdict.id)
        )
        events = connection.execute(
            select(Event.created_at, Event.step_number, Event.kind, Event.author, Event.text)
            .where(Event.episode_id == episode_id)
            .order_by(Event.id)
        )
        counts, goal_instance = connection.execute(
            episodes_of_trials(COUNTS, GOAL_INSTANCE).where(Episode.id == episode_id)
        ).one()
        details = EpisodeDetails(
            summary=summary,
            seed=episode.seed,
            ended_with=episode.end_reason,
            error=episode.error,
            goal_instance=goal_instance,
            wall_duration_s=episode.wall_duration_s,
            geodesic_end_m=episode.geodesic_end_m,
            placement=fix_of_columns(
                episode.start_x_m, episode.start_y_m, episode.start_heading_rad, episode.start_source or _GUESSED
            ),
            measured=placement_of(connection, episode_id),
            session=session_of(connection, episode_id),
            final=fix_of_columns(episode.final_x_m, episode.final_y_m, episode.final_heading_rad, episode.final_source),
            counts=bool(counts),
            verdicts=tuple(RecordedVerdict(*tuple(row)) for row in verdicts),
            events=tuple(RecordedEvent(*row) for row in events),
            provenance=_provenance(connection, episode_id),
        )
        return hide_details(details) if blind_episodes(connection, [episode_id]) else details


def pending_episodes(engine: Engine) -> tuple[PendingEpisode, ...]:
    """Return the episodes that await a person's word, in the order of their numbers.

    Raises:
        RecordError: the database cannot be read.
    """
    proposal, each = aliased(Verdict), aliased(Verdict)
    latest = select(func.max(each.id)).where(each.episode_id == Episode.id, each.proposed.is_(True))
    query = (
        episodes_of_campaigns(
            *(Episode.id, MODEL_NAME, Robot.name, Trial.goal, Trial.start, Trial.repetition, Episode.origin),
            *(Episode.end_reason, Episode.ended_at, proposal.reason, proposal.success),
        )
        .outerjoin(proposal, proposal.id == latest.scalar_subquery())
        .where(Episode.state == EpisodeState.AWAITING.value)
        .order_by(Episode.id)
    )
    with _reader(engine) as connection:
        return tuple(PendingEpisode(*row) for row in connection.execute(query))


def episode_steps(engine: Engine, episode_id: int) -> tuple[StepRecord, ...]:
    """Return the committed steps of an episode in order; none when it does not exist.

    Raises:
        RecordError: the database cannot be read, or a step in it is none.
    """
    query = select(Step.__table__).where(Step.episode_id == episode_id).order_by(Step.number)
    with _reader(engine) as connection:
        steps = tuple(_step(row) for row in connection.execute(query))
        return hide_steps(steps) if blind_episodes(connection, [episode_id]) else steps


def _step(row: Any) -> StepRecord:
    try:
        return step_of_row(row)
    except ValueError as error:
        where = f"episode {row.episode_id}, step {row.number}"
        raise RecordError(f"{where}: {harmless(str(error))[:80]}; the record is damaged") from error


def campaign_states(engine: Engine) -> tuple[CampaignState, ...]:
    """Return every campaign with its progress, in the order of their creation.

    Raises:
        RecordError: the database cannot be read.
    """
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
        )
        .join(Model, Model.id == Campaign.model_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .join(Site, Site.id == Campaign.site_id)
        .order_by(Campaign.id)
    )
    with _reader(engine) as connection:
        return tuple(CampaignState(*row) for row in connection.execute(query))


def images_directories(engine: Engine, uuids: Collection[str]) -> dict[str, str]:
    """Return, of these episodes, where the images of those lie that are in the record.

    Raises:
        RecordError: the database cannot be read.
    """
    wanted = sorted(uuids)
    found: dict[str, str] = {}
    with _reader(engine) as connection:
        for first in range(0, len(wanted), _AT_ONCE):
            some = Episode.uuid.in_(wanted[first : first + _AT_ONCE])
            found |= {row.uuid: row.images_directory for row in connection.execute(_PLACES.where(some))}
    return found


_AT_ONCE = 500
_PLACES = select(Episode.uuid, Episode.images_directory)


@contextmanager
def _reader(engine: Engine) -> Iterator[Connection]:
    with record_errors(engine), reading(engine).begin() as connection:
        yield connection


def _summary_query() -> Select[*tuple[Any, ...]]:
    """Select the columns of EpisodeSummary, in its order."""
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
        Episode.geodesic_start_m,
        Episode.duration_s,
        Episode.started_at,
        Episode.ended_at,
        Episode.images_directory,
    )


def _restricted(query: Select[*tuple[Any, ...]], which: EpisodeFilter) -> Select[*tuple[Any, ...]]:
    if which.model:
        query = query.where(MODEL_NAME.in_([which.model]))
    if which.goal:
        query = query.where(Trial.goal == which.goal)
    if which.campaign.isdecimal() and len(which.campaign) < _SHORTEST_KEY:
        query = query.where(or_(Campaign.id == int(which.campaign), CAMPAIGN_NAME.in_([which.campaign])))
    elif which.campaign:
        same: list[ColumnElement[bool]] = [CAMPAIGN_NAME.in_([which.campaign])]
        if len(which.campaign) >= _SHORTEST_KEY:
            same.append(CAMPAIGN_KEY.startswith(which.campaign, autoescape=True))
        query = query.where(or_(*same))
    match which.outcome:
        case "":
            return query
        case "success":
            return query.where(SUCCESS.is_(True))
        case "failure":
            return query.where(SUCCESS.is_(False))
        case "running":
            return query.where(Episode.state.in_([state.value for state in ACTIVE]))
        case "unjudged":
            return query.where(Episode.state == EpisodeState.AWAITING.value)
        case "void":
            return query.where(Episode.state == EpisodeState.VOID.value)
        case reason:
            return query.where(END_REASON.in_([reason]))


_SHORTEST_KEY = 8
"""The beginning of a campaign's key has at least so many digits: a shorter number is the campaign's own."""


def _one_summary(connection: Connection, episode_id: int) -> EpisodeSummary:
    row = connection.execute(_summary_query().where(Episode.id == episode_id)).first()
    if row is None:
        raise UsageError(f"there is no episode {episode_id}", advice="`vsnbench episodes list` shows them")
    return EpisodeSummary(*row)


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
            Campaign.key,
            Campaign.seed,
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
    return EpisodeProvenance(*row)


_GUESSED = PoseSource.ESTIMATED.value
"""How a pose is known of which the record does not say it."""
