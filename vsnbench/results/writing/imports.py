"""Imports episodes of other tools, all of a file or none, and withdraws imports."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from uuid import uuid4

from sqlalchemy import Connection, insert, select

from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.schema.row_encoding import insert_row, number
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, RobotRow, StepRow, TrialRow
from vsnbench.results.writing import campaigns
from vsnbench.results.writing.campaigns import CampaignPlan
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.episodes import PlaceFiles, attach_images, end_episode
from vsnbench.results.writing.judging import judge
from vsnbench.results.writing.lifecycle import RESULTS, EpisodeState
from vsnbench.results.writing.steps import step_row
from vsnbench.values.robot_identity import IMPORTED
from vsnbench.values.step import StepRecord


@dataclass(frozen=True, slots=True)
class ImportedEpisode:
    """An episode of another tool."""

    end: EpisodeEnd
    steps: Sequence[StepRecord] = ()
    shortest_m: float | None = None
    started_at: datetime | None = None
    judged: Verdict | None = None
    """The tool's judgement; None awaits an operator's."""
    author: str = ""
    """Author of the judgement."""
    has_images: bool = False
    uuid: str = field(default_factory=lambda: str(uuid4()))


def import_episodes(
    connection: Connection,
    process_id: int,
    plan: CampaignPlan,
    episodes: Sequence[ImportedEpisode],
    place_files: PlaceFiles | None,
) -> tuple[int, tuple[int, ...]]:
    """Write the episodes within a transaction; see `Journal.import_campaign`."""
    campaign = campaigns.find_or_create(connection, plan, process_id)
    progress = campaigns.campaign_progress(connection, campaign, process_id)
    if len(progress.left) < len(campaign.trials):
        raise UsageError(
            f"{plan.name}: these episodes are already in the record, as campaign {campaign.id}",
            advice=f"`vsnbench db remove-import {campaign.id}` voids them",
        )
    numbers = []
    for trial, given in zip(campaign.trials, episodes, strict=True):
        episode_id = insert_row(
            connection,
            EpisodeRow,
            {
                "uuid": given.uuid,
                "trial_id": trial.id,
                "process_id": process_id,
                "origin": IMPORTED,
                "state": EpisodeState.RUNNING.value,
                "seed": 0,
                "started_at": given.started_at or datetime.now(UTC),
                "error": "",
                "actions": 0,
                "geodesic_start_m": number(given.shortest_m),
                "images_directory": "",
            },
        )
        if given.has_images and place_files:
            place_files(given.uuid, attach_images(connection, episode_id))
        if given.steps:
            connection.execute(insert(StepRow), [step_row(episode_id, step) for step in given.steps])
        end_episode(connection, process_id, episode_id, given.end)
        if given.judged is not None:
            judge(connection, episode_id, given.judged, author=given.author, source="import")
        numbers.append(episode_id)
    return campaign.id, tuple(numbers)


def withdraw(connection: Connection, campaign_id: int, *, author: str, note: str) -> int:
    """Void an import's episodes within a transaction; see `Journal.withdraw_import`."""
    kind = connection.execute(
        select(RobotRow.kind)
        .join(CampaignRow, CampaignRow.robot_id == RobotRow.id)
        .where(CampaignRow.id == campaign_id)
    ).scalar()
    if kind is None:
        raise UsageError(f"campaign {campaign_id} does not exist", advice="`vsnbench db status` lists the campaigns")
    if kind != IMPORTED:
        raise UsageError(
            f"campaign {campaign_id} was run here, not imported",
            advice="`vsnbench judge N --void WHY` voids one of its episodes",
        )
    numbers = connection.scalars(
        select(EpisodeRow.id)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .where(TrialRow.campaign_id == campaign_id, EpisodeRow.state.in_([state.value for state in RESULTS]))
    ).all()
    void = Verdict(EndReason.ABORTED, None, "void: the import was withdrawn")
    for episode_id in numbers:
        judge(connection, episode_id, void, author=author, source="person", note=note)
    return len(numbers)
