"""Queries of episodes, their details and steps, and of campaigns.

They raise RecordError if the database cannot be read.
"""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

from sqlalchemy import Engine, func, select

from vsnbench.errors import RecordError, UsageError
from vsnbench.results.annotations import tags_of
from vsnbench.results.fields import Fields, fields_of
from vsnbench.results.goals import goal_of_trial, with_goals
from vsnbench.results.model import (
    CAMPAIGN,
    EPISODE,
    PROVENANCE,
    Campaign,
    Episode,
    EpisodeProvenance,
    EpisodeRecord,
    RecordedEvent,
    RecordedVerdict,
)
from vsnbench.results.reading.blinding import blind_episodes, hide_record, hide_steps
from vsnbench.results.reading.filtering import EpisodeFilter, restricted
from vsnbench.results.reading.read_model import MODEL_NAME, OUTCOME, episodes_of_campaigns, episodes_of_trials
from vsnbench.results.schema import tables
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.schema.row_encoding import parts
from vsnbench.results.writing.sessions import placement_of, session_of, stop_of
from vsnbench.results.writing.steps import step_of_row
from vsnbench.text.sanitize import sanitize
from vsnbench.values.step import StepRecord

_VERDICT, _EVENT = fields_of(RecordedVerdict), fields_of(RecordedEvent)


def list_episodes(engine: Engine, which: EpisodeFilter, limit: int | None = None) -> tuple[Episode, ...]:
    """Return episodes by number; with a limit, the latest ones."""
    with transaction(reading(engine)) as connection:
        query = restricted(connection, episodes_of_campaigns(*EPISODE.columns()), which)
        if limit is None:
            rows = connection.execute(query.order_by(tables.EpisodeRow.id)).all()
        else:
            rows = connection.execute(query.order_by(tables.EpisodeRow.id.desc()).limit(limit)).all()[::-1]
        found = list(EPISODE.read(Episode, rows, tags=()))
        tags = tags_of(connection, (episode.id for episode in found))
        return tuple(replace(episode, tags=tags[episode.id]) if episode.id in tags else episode for episode in found)


def episode_rows(engine: Engine, fields: Fields) -> list[list[Any]]:
    """Return some quantities of all episodes, the number among them, by number; for lists that are too long for values.

    `fields` must have the number and the tags.
    """
    query = episodes_of_campaigns(*fields.columns()).order_by(tables.EpisodeRow.id)
    place = fields.names.index("id")
    with transaction(reading(engine)) as connection:
        rows = list(fields.rows(connection.execute(query)))
        tags = tags_of(connection, (row[place] for row in rows))
    end = fields.names.index("tags")
    for row in rows:
        row.insert(end, tags.get(row[place], ()))
    return rows


def count_episodes(engine: Engine, which: EpisodeFilter) -> int:
    """Return the number of episodes that match a filter."""
    with transaction(reading(engine)) as connection:
        query = restricted(connection, episodes_of_campaigns(func.count(tables.EpisodeRow.id)), which)
        return int(connection.execute(query).scalar_one())


def outcome_counts(engine: Engine) -> dict[str, int]:
    """Return the number of episodes by outcome, in the order of `Episode.outcome`'s words."""
    query = episodes_of_trials(OUTCOME, func.count()).group_by(OUTCOME)
    with transaction(reading(engine)) as connection:
        found: dict[str, int] = dict(connection.execute(query).all())
    return {outcome: found.get(outcome, 0) for outcome in ("success", "failure", "unjudged", "void", "running")}


def episode_record(engine: Engine, episode_id: int) -> EpisodeRecord:
    """Return one episode with its verdicts, events and provenance.

    Raises:
        UsageError: the episode does not exist.
    """
    this = tables.EpisodeRow.id == episode_id
    with transaction(reading(engine)) as connection:

        def all_of(fields: Fields, kind: type[Any], table: Any) -> tuple[Any, ...]:
            query = select(*fields.columns()).where(table.episode_id == episode_id).order_by(table.id)
            return tuple(fields.read(kind, connection.execute(query)))

        rows = connection.execute(episodes_of_campaigns(*EPISODE.columns()).where(this)).all()
        trial_id = connection.scalar(select(tables.EpisodeRow.trial_id).where(this))
        if trial_id is None:
            raise _unknown(episode_id)
        process = tables.ProcessRow.id == tables.EpisodeRow.process_id
        origin = episodes_of_campaigns(*PROVENANCE.columns()).join(tables.ProcessRow, process).where(this)
        (provenance,) = PROVENANCE.read(EpisodeProvenance, connection.execute(origin))
        campaign_id = connection.scalar(select(tables.TrialRow.campaign_id).where(tables.TrialRow.id == trial_id))
        content = with_goals(connection, provenance.site_content, [campaign_id or 0])
        (episode,) = EPISODE.read(
            EpisodeRecord,
            rows,
            tags=tags_of(connection, [episode_id]).get(episode_id, ()),
            goal_definition=goal_of_trial(connection, trial_id),
            measured=placement_of(connection, episode_id),
            stopped=stop_of(connection, episode_id),
            session=session_of(connection, episode_id),
            verdicts=all_of(_VERDICT, RecordedVerdict, tables.VerdictRow),
            events=all_of(_EVENT, RecordedEvent, tables.EventRow),
            provenance=replace(provenance, site_content=content),
        )
        return hide_record(episode) if blind_episodes(connection, [episode_id]) else episode


def _unknown(episode_id: int) -> UsageError:
    """Return the error for an episode that does not exist."""
    return UsageError(
        f"episode {episode_id} does not exist",
        advice="`vsnbench episodes list` lists the episodes",
        code="unknown-episode",
    )


def images_of(engine: Engine, episode_id: int, *, film: bool = False) -> str:
    """Return the directory of an episode's images as recorded; empty without any.

    It is also empty for the `film` of a blinded arm: the number of its frames gives the time between two answers.

    Raises:
        UsageError: the episode does not exist.
    """
    with transaction(reading(engine)) as connection:
        query = select(tables.EpisodeRow.images_directory).where(tables.EpisodeRow.id == episode_id)
        if (row := connection.execute(query).first()) is None:
            raise _unknown(episode_id)
        hides = film and blind_episodes(connection, [episode_id])
        return "" if hides else str(row.images_directory)


def proposals(engine: Engine, numbers: Collection[int]) -> dict[int, RecordedVerdict]:
    """Return the protocol's latest proposal for each of some episodes that has one."""
    latest = select(func.max(tables.VerdictRow.id)).where(tables.VerdictRow.proposed.is_(True))
    latest = latest.group_by(tables.VerdictRow.episode_id)
    query = select(tables.VerdictRow.episode_id, *_VERDICT.columns())
    with transaction(reading(engine)) as connection:
        rows = [
            row
            for some in parts(numbers)
            for row in connection.execute(
                query.where(tables.VerdictRow.id.in_(latest.where(tables.VerdictRow.episode_id.in_(some))))
            )
        ]
    verdicts = _VERDICT.read(RecordedVerdict, (row[1:] for row in rows))
    return {row[0]: verdict for row, verdict in zip(rows, verdicts, strict=True)}


def episode_steps(engine: Engine, episode_id: int) -> tuple[StepRecord, ...]:
    """Return the committed steps of an episode in order; empty if it does not exist.

    Raises:
        RecordError: a step is invalid.
    """
    query = (
        select(tables.StepRow.__table__).where(tables.StepRow.episode_id == episode_id).order_by(tables.StepRow.number)
    )
    with transaction(reading(engine)) as connection:
        steps = tuple(_step(row) for row in connection.execute(query))
        return hide_steps(steps) if blind_episodes(connection, [episode_id]) else steps


def _step(row: Any) -> StepRecord:
    try:
        return step_of_row(row)
    except ValueError as error:
        where = f"episode {row.episode_id}, step {row.number}"
        raise RecordError(f"{where}: {sanitize(str(error))[:80]}; the record is damaged") from error


def list_campaigns(engine: Engine) -> tuple[Campaign, ...]:
    """Return all campaigns with their progress, in order of creation."""
    query = (
        select(*CAMPAIGN.columns())
        .join(tables.ModelRow, tables.ModelRow.id == tables.CampaignRow.model_id)
        .join(tables.RobotRow, tables.RobotRow.id == tables.CampaignRow.robot_id)
        .join(tables.SiteRow, tables.SiteRow.id == tables.CampaignRow.site_id)
        .order_by(tables.CampaignRow.id)
    )
    with transaction(reading(engine)) as connection:
        return tuple(CAMPAIGN.read(Campaign, connection.execute(query)))


def images_directories(engine: Engine, uuids: Collection[str]) -> dict[str, str]:
    """Return the image directories of those of these episodes that are in the record."""
    query = select(tables.EpisodeRow.uuid, tables.EpisodeRow.images_directory)
    with transaction(reading(engine)) as connection:
        rows = [
            row for some in parts(uuids) for row in connection.execute(query.where(tables.EpisodeRow.uuid.in_(some)))
        ]
    return {row.uuid: row.images_directory for row in rows}


def recorded_models(engine: Engine) -> set[str]:
    """Return the names of all models with campaigns; codes for blinded arms."""
    with transaction(reading(engine)) as connection:
        return set(connection.scalars(episodes_of_campaigns(MODEL_NAME).distinct()))


def recorded_goals(engine: Engine) -> set[str]:
    """Return the goals that have trials."""
    with transaction(reading(engine)) as connection:
        return set(connection.scalars(select(tables.TrialRow.goal).distinct()))
