"""Takes another tool's episodes into the record, all of a file or none of it, and lets an import be withdrawn."""

import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, insert, select, update

from vsnbench.database import campaign_plan
from vsnbench.database.campaign_plan import CampaignPlan
from vsnbench.database.episode_entries import EpisodeEnd
from vsnbench.database.episodes import end_episode, images_directory
from vsnbench.database.judging import judge
from vsnbench.database.lifecycle import RESULTS, EpisodeState
from vsnbench.database.row_encoding import insert_row, number
from vsnbench.database.step_rows import step_row
from vsnbench.database.tables import Campaign, Episode, Robot, Step, Trial
from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.step_record import StepRecord

IMPORTED = "imported"
"""Origin of such an episode, and the kind of a robot that another tool drove."""

KeepFiles = Callable[[int, str], None]


@dataclass(frozen=True, slots=True)
class ImportedEpisode:
    """One episode as another tool tells it."""

    end: EpisodeEnd
    steps: Sequence[StepRecord] = ()
    geodesic_m: float | None = None
    started_at: datetime | None = None
    judged: Verdict | None = None
    """The tool's own judgement; None awaits a person's."""
    author: str = ""
    """Whose judgement it is."""
    has_images: bool = False


def import_episodes(
    connection: Connection,
    process_id: int,
    plan: CampaignPlan,
    episodes: Sequence[ImportedEpisode],
    keep_files: KeepFiles | None = None,
) -> tuple[int, tuple[int, ...]]:
    """Write the episodes within a transaction; see `Journal.import_campaign`."""
    campaign = campaign_plan.find_or_create(connection, plan, process_id)
    standing = campaign_plan.standing(connection, campaign, process_id)
    if len(standing.left) < len(campaign.trials):
        raise UsageError(
            f"{plan.name}: these episodes are in the record already, as campaign {campaign.id}",
            advice=f"`vsnbench import withdraw {campaign.id}` makes them void",
        )
    numbers = []
    for place, (trial, given) in enumerate(zip(campaign.trials, episodes, strict=True)):
        episode_id = insert_row(
            connection,
            Episode,
            {
                "uuid": str(uuid.uuid4()),
                "trial_id": trial.id,
                "process_id": process_id,
                "origin": IMPORTED,
                "state": EpisodeState.RUNNING.value,
                "seed": 0,
                "started_at": given.started_at or datetime.now(UTC),
                "error": "",
                "actions": 0,
                "geodesic_start_m": number(given.geodesic_m),
                "images_directory": "",
            },
        )
        if given.has_images and keep_files:
            directory = images_directory(episode_id)
            connection.execute(update(Episode).where(Episode.id == episode_id).values(images_directory=directory))
            keep_files(place, directory)
        if given.steps:
            connection.execute(insert(Step), [step_row(episode_id, step) for step in given.steps])
        end_episode(connection, process_id, episode_id, given.end)
        if given.judged is not None:
            judge(connection, episode_id, given.judged, author=given.author, source="import")
        numbers.append(episode_id)
    return campaign.id, tuple(numbers)


def withdraw(connection: Connection, campaign_id: int, *, author: str, note: str) -> int:
    """Make an import's episodes void within a transaction; see `Journal.withdraw_import`."""
    kind = connection.execute(
        select(Robot.kind).join(Campaign, Campaign.robot_id == Robot.id).where(Campaign.id == campaign_id)
    ).scalar()
    if kind is None:
        raise UsageError(f"there is no campaign {campaign_id}", advice="`vsnbench db status` shows them")
    if kind != IMPORTED:
        raise UsageError(
            f"campaign {campaign_id} was run here, not imported",
            advice="`vsnbench judge N --void WHY` makes one of its episodes void",
        )
    numbers = connection.scalars(
        select(Episode.id)
        .join(Trial, Trial.id == Episode.trial_id)
        .where(Trial.campaign_id == campaign_id, Episode.state.in_([state.value for state in RESULTS]))
    ).all()
    void = Verdict(EndReason.ABORTED, None, "void: the import was withdrawn")
    for episode_id in numbers:
        judge(connection, episode_id, void, author=author, source="person", note=note)
    return len(numbers)
