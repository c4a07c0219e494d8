"""Finds a campaign or makes it, and extends its plan; two who do it at once make one."""

from collections.abc import Sequence

from sqlalchemy import Connection, func, select

from vsnbench.database.campaign_plan import (
    CampaignPlan,
    CampaignStanding,
    OpenCampaign,
    PlannedTrial,
    TrialStanding,
)
from vsnbench.database.campaign_plan import Trial as KnownTrial
from vsnbench.database.insertion import find_or_insert, insert_if_absent
from vsnbench.database.lifecycle import EpisodeState
from vsnbench.database.read_model import SUCCESS, standing_verdict_id
from vsnbench.database.row_encoding import campaign_row, model_row, robot_row, site_row
from vsnbench.database.tables import Campaign, Episode, Model, Process, Robot, Site, Trial, Verdict


def find_or_create(connection: Connection, plan: CampaignPlan, process_id: int) -> OpenCampaign:
    """Return the campaign of the plan's condition and seed, with all that the plan asks for planned in it."""
    key = plan.key
    there = connection.execute(select(Campaign.id).where(Campaign.key == key)).scalar()
    if there is None:
        there = find_or_insert(
            connection,
            Campaign,
            {
                **campaign_row(plan),
                "site_id": find_or_insert(connection, Site, site_row(plan.site), "sha256"),
                "robot_id": find_or_insert(connection, Robot, robot_row(plan.robot), "sha256"),
                "model_id": find_or_insert(connection, Model, model_row(plan.model), "sha256"),
                "process_id": process_id,
            },
            "key",
        )
    # On a server this row is the lock by which two who extend one plan do it one after the other.
    campaign = connection.execute(select(Campaign).where(Campaign.id == there).with_for_update()).one()
    before = _trials(connection, there)
    new = [trial for trial in plan.trials if trial not in before]
    if new:
        extend_plan(connection, there, new)
    known = _trials(connection, there) if new else before
    return OpenCampaign(
        id=there,
        key=key,
        name=campaign.name,
        seed=campaign.seed,
        resumed=bool(before),
        trials=tuple(known[trial] for trial in plan.trials),
        added=len(new),
    )


def _trials(connection: Connection, campaign_id: int) -> dict[PlannedTrial, KnownTrial]:
    rows = connection.execute(
        select(Trial.id, Trial.campaign_id, Trial.goal, Trial.start, Trial.repetition).where(
            Trial.campaign_id == campaign_id
        )
    )
    return {PlannedTrial(row.goal, row.start, row.repetition): KnownTrial(*row) for row in rows}


def extend_plan(connection: Connection, campaign_id: int, new: Sequence[PlannedTrial]) -> None:
    """Plan trials that a campaign does not have, in this order, after those that it has."""
    highest = connection.execute(select(func.max(Trial.rank)).where(Trial.campaign_id == campaign_id)).scalar()
    first = 0 if highest is None else highest + 1
    connection.execute(
        insert_if_absent(connection, Trial, ["campaign_id", "goal", "start", "repetition"]),
        [
            {
                "campaign_id": campaign_id,
                "rank": rank,
                "goal": one.goal,
                "start": one.start,
                "repetition": one.repetition,
            }
            for rank, one in enumerate(new, start=first)
        ],
    )


def standing(connection: Connection, campaign: OpenCampaign, process_id: int) -> CampaignStanding:
    """Say what has become of the trials of an open campaign, in its order."""
    first = (
        select(func.min(Episode.id))
        .where(Episode.trial_id == Trial.id, Episode.state != EpisodeState.VOID.value)
        .correlate(Trial)
        .scalar_subquery()
    )
    rows = connection.execute(
        select(Trial.id, Episode.id, Episode.state, SUCCESS, Episode.process_id, Process.pid, Process.host)
        .select_from(Trial)
        .join(Episode, Episode.id == first)
        .join(Process, Process.id == Episode.process_id)
        .outerjoin(Verdict, Verdict.id == standing_verdict_id(Episode.id))
        .where(Trial.campaign_id == campaign.id)
    )
    taken = {
        trial: (episode, EpisodeState(state), success, at == process_id, f"process {pid} on {host}")
        for trial, episode, state, success, at, pid, host in rows
    }
    free = (None, None, None, False)
    return CampaignStanding(tuple(TrialStanding(trial, *taken.get(trial.id, free)) for trial in campaign.trials))
