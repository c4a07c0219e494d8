"""Campaigns: a condition and a seed, with planned trials and their progress.

Concurrent processes that open the same campaign share one row.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, func, select

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.goals import store_goals
from vsnbench.results.reading.read_model import SUCCESS, current_verdict_id, first_attempt
from vsnbench.results.schema import tables
from vsnbench.results.schema.engine import to_json
from vsnbench.results.schema.row_encoding import Row, find_or_insert, insert_if_absent, text
from vsnbench.results.writing.lifecycle import ACTIVE, EpisodeState
from vsnbench.sites.site import Site
from vsnbench.values.model.card import ModelCard
from vsnbench.values.robot_identity import RobotIdentity


def content_sha256(content: object) -> str:
    """Return the hash of a JSON value, independent of the order of its keys."""
    return hashlib.sha256(to_json(content, in_order=True).encode()).hexdigest()


def model_sha256(card: ModelCard) -> str:
    """Return the hash that identifies a model: of name, weights, settings, files and code."""
    return content_sha256(card.identity)


def card_of_row(row: Any) -> ModelCard:
    """Return the part of a recorded model's card that identifies it, from a row of the table `model`.

    Raises:
        ValueError: the content of the row is invalid.
    """
    names = ("name", "weights_sha256", "weights_label", "settings", "surveyed", "files", "code")
    return ModelCard(**{name: getattr(row, name) for name in names})


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial of a campaign. Trials of the same cell and repetition are equal, planned or in the database."""

    goal: str
    start: int
    repetition: int = 1
    """From 1."""
    id: int = field(default=0, compare=False, kw_only=True)
    """0 for a trial that is not in the database."""
    campaign_id: int = field(default=0, compare=False, kw_only=True)


def trial_seed(campaign_seed: int, goal: str, start: int, repetition: int) -> int:
    """Return the seed of a trial's episodes, independent of the order of the trials."""
    text = f"{campaign_seed}/{goal}/{start}/{repetition}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


def protocol_sha256(parameters: ProtocolParameters) -> str:
    """Return the hash of a protocol's parameters."""
    return content_sha256(parameters.model_dump(mode="json"))


@dataclass(frozen=True, slots=True)
class CampaignPlan:
    """A condition, a seed and requested trials; equal conditions and seeds are the same campaign.

    Raises:
        ValueError: no trials, or duplicate trials.
    """

    site: Site
    robot: RobotIdentity
    model: ModelCard
    protocol: ProtocolParameters
    seed: int
    trials: Sequence[Trial]
    """In running order."""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    """Conditions reported by the robot."""
    name: str = ""
    """Display name, not part of the key."""

    def __post_init__(self) -> None:
        if not self.trials:
            raise ValueError("a campaign needs at least one trial")
        if len(set(self.trials)) != len(self.trials):
            raise ValueError("a trial is planned twice")

    @property
    def protocol_sha256(self) -> str:
        """Hash of the protocol's parameters."""
        return protocol_sha256(self.protocol)

    @property
    def key(self) -> str:
        """Hash of the condition and the seed, without the trials."""
        parts = [self.site.sha256, self.robot.sha256, model_sha256(self.model), self.protocol_sha256]
        return content_sha256([*parts, dict(self.conditions), self.seed])


@dataclass(frozen=True, slots=True)
class OpenCampaign:
    """An open campaign with the trials that were requested."""

    id: int
    seed: int
    resumed: bool
    """The campaign existed before."""
    trials: tuple[Trial, ...]
    """Requested trials in the order of the plan; the campaign may have more."""


@dataclass(frozen=True, slots=True)
class TrialProgress:
    """State of a trial, from its first episode that is not void."""

    trial: Trial
    episode_id: int | None
    state: EpisodeState | None
    """None if the trial is open."""
    success: bool | None
    """None unless judged."""
    here: bool
    """The episode belongs to this process."""
    holder: str = ""
    """Description of the process of the episode; empty if the trial is open."""


@dataclass(frozen=True, slots=True)
class CampaignProgress:
    """States of the requested trials."""

    trials: tuple[TrialProgress, ...]

    @property
    def left(self) -> tuple[Trial, ...]:
        """Open trials in the order of the plan."""
        return tuple(trial.trial for trial in self.trials if trial.state is None)

    @property
    def elsewhere(self) -> tuple[TrialProgress, ...]:
        """Trials that are active in another process."""
        return tuple(trial for trial in self.trials if trial.state in ACTIVE and not trial.here)

    @property
    def awaiting(self) -> tuple[TrialProgress, ...]:
        """Trials that await an operator's judgement."""
        return tuple(trial for trial in self.trials if trial.state is EpisodeState.AWAITING)

    @property
    def outcomes(self) -> tuple[bool, ...]:
        """Success of each judged trial."""
        return tuple(bool(trial.success) for trial in self.trials if trial.state is EpisodeState.JUDGED)


def find_or_create(connection: Connection, plan: CampaignPlan, process_id: int) -> OpenCampaign:
    """Return the campaign of a plan with all requested trials."""
    there = connection.scalar(select(tables.CampaignRow.id).where(tables.CampaignRow.key == plan.key))
    if there is None:
        there = find_or_insert(
            connection,
            tables.CampaignRow,
            {
                **campaign_row(plan),
                "site_id": find_or_insert(connection, tables.SiteRow, site_row(plan.site), "sha256"),
                "robot_id": find_or_insert(connection, tables.RobotRow, robot_row(plan.robot), "sha256"),
                "model_id": find_or_insert(connection, tables.ModelRow, model_row(plan.model), "sha256"),
                "process_id": process_id,
            },
            "key",
        )
    # On a server this row serves as the lock for concurrent extensions of a plan.
    connection.execute(select(tables.CampaignRow.id).where(tables.CampaignRow.id == there).with_for_update())
    before = _trials(connection, there)
    goals = store_goals(connection, there, plan.site.goals, {trial.goal for trial in plan.trials})
    new = [trial for trial in plan.trials if trial not in before]
    if new:
        extend_plan(connection, there, new, goals)
    known = _trials(connection, there) if new else before
    return OpenCampaign(
        id=there,
        seed=plan.seed,
        resumed=bool(before),
        trials=tuple(known[trial] for trial in plan.trials),
    )


def _trials(connection: Connection, campaign_id: int) -> dict[Trial, Trial]:
    """Return the trials of a campaign in the database, each by what is planned of it."""
    rows = connection.execute(select(tables.TrialRow).where(tables.TrialRow.campaign_id == campaign_id))
    stored = (Trial(row.goal, row.start, row.repetition, id=row.id, campaign_id=campaign_id) for row in rows)
    return {trial: trial for trial in stored}


def extend_plan(
    connection: Connection, campaign_id: int, new: Sequence[Trial], goals: Mapping[str, int] | None = None
) -> None:
    """Append new trials to the plan of a campaign, in this order; `goals` are the definitions by name."""
    highest = connection.scalar(
        select(func.max(tables.TrialRow.rank)).where(tables.TrialRow.campaign_id == campaign_id)
    )
    first = 0 if highest is None else highest + 1
    connection.execute(
        insert_if_absent(connection, tables.TrialRow, ["campaign_id", "goal", "start", "repetition"]),
        [
            {
                "campaign_id": campaign_id,
                "rank": rank,
                "goal": trial.goal,
                "goal_id": (goals or {}).get(trial.goal),
                "start": trial.start,
                "repetition": trial.repetition,
            }
            for rank, trial in enumerate(new, start=first)
        ],
    )


def campaign_progress(connection: Connection, campaign: OpenCampaign, process_id: int) -> CampaignProgress:
    """Return the states of the trials of an open campaign, in its order."""
    rows = connection.execute(
        select(
            tables.TrialRow.id,
            tables.EpisodeRow.id,
            tables.EpisodeRow.state,
            SUCCESS,
            tables.EpisodeRow.process_id,
            tables.ProcessRow.pid,
            tables.ProcessRow.host,
        )
        .select_from(tables.TrialRow)
        .join(tables.EpisodeRow, tables.EpisodeRow.id == first_attempt(tables.TrialRow.id))
        .join(tables.ProcessRow, tables.ProcessRow.id == tables.EpisodeRow.process_id)
        .outerjoin(tables.VerdictRow, tables.VerdictRow.id == current_verdict_id(tables.EpisodeRow.id))
        .where(tables.TrialRow.campaign_id == campaign.id)
    )
    taken = {
        trial: (episode, EpisodeState(state), success, at == process_id, f"process {pid} on {host}")
        for trial, episode, state, success, at, pid, host in rows
    }
    free = (None, None, None, False)
    return CampaignProgress(tuple(TrialProgress(trial, *taken.get(trial.id, free)) for trial in campaign.trials))


def site_row(site: Site) -> Row:
    """Return the row of a site."""
    return {"sha256": site.sha256, "name": site.name, "title": site.title, "content": site.content()}


def robot_row(robot: RobotIdentity) -> Row:
    """Return the row of a robot."""
    return {
        "sha256": robot.sha256,
        "kind": text(robot.kind),
        "name": robot.profile.name,
        "title": robot.profile.title,
        "simulated": robot.simulated,
        "profile": robot.profile.content(),
    }


def model_row(model: ModelCard) -> Row:
    """Return the row of a model."""
    columns = ("weights_sha256", "files", "code", "settings", "goals", "sensors", "surveyed")
    values = model.as_json()
    return {
        "sha256": model_sha256(model),
        "name": text(model.name),
        "weights_label": text(model.weights_label),
        **{column: values[column] for column in columns},
    }


def campaign_row(plan: CampaignPlan) -> Row:
    """Return the row of a campaign, without foreign keys."""
    return {
        "key": plan.key,
        "name": text(plan.name) or _campaign_name(plan),
        "created_at": datetime.now(UTC),
        "protocol": plan.protocol.model_dump(mode="json"),
        "protocol_sha256": plan.protocol_sha256,
        "conditions": dict(plan.conditions),
        "seed": plan.seed,
    }


def _campaign_name(plan: CampaignPlan) -> str:
    simulated = "simulated " if plan.robot.simulated else ""
    return f"{text(plan.model.name)} on {simulated}{plan.robot.profile.name} in {plan.site.name}"
