"""What a campaign is: a condition and a seed, the trials that are asked for, and what has become of them.

It is found or made here, and its plan extended; two who do it at once make one.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, Engine, func, select

from vsnbench.database import tables
from vsnbench.database.engine import reading, to_json, transaction
from vsnbench.database.lifecycle import ACTIVE, EpisodeState
from vsnbench.database.read_model import SUCCESS, standing_verdict_id
from vsnbench.database.row_encoding import Row, find_or_insert, insert_if_absent, text
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.protocol.site import Site


def content_sha256(content: object) -> str:
    """Return the hash of a JSON value that does not depend on the order of its keys."""
    return hashlib.sha256(to_json(content, in_order=True).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class ModelIdentity:
    """A policy with its weights and settings, as far as results depend on them."""

    name: str
    goals: frozenset[str] | None = None
    sensors: frozenset[str] = frozenset()
    weights_sha256: str = ""
    weights_label: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    surveyed: bool = False
    """It is handed the site."""
    files: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of the files that were handed to it, by what they were handed over as."""
    code: Mapping[str, str] = field(default_factory=dict)
    """Of a third party's policy: its class, the hash of its source, its package's version and commit."""

    @property
    def sha256(self) -> str:
        """Hash of what tells one model from another: name, weights, settings, files and code."""
        content = [self.name, self.weights_sha256, dict(self.settings), self.surveyed]
        # A commit that changes nothing of the source makes no other model.
        code = {name: value for name, value in self.code.items() if name != "commit"}
        return content_sha256([*content, dict(self.files), code] if self.files or code else content)


@dataclass(frozen=True, slots=True)
class PlannedTrial:
    """One cell of a plan; `repetition` counts from 1."""

    goal: str
    start: int
    repetition: int = 1


def trial_seed(campaign_seed: int, goal: str, start: int, repetition: int) -> int:
    """Return the seed of a trial's episodes: of the trial itself, whatever the order it is run in."""
    text = f"{campaign_seed}/{goal}/{start}/{repetition}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


@dataclass(frozen=True, slots=True)
class CampaignPlan:
    """A condition, a seed, and the trials that somebody asks for; equal conditions and seeds are one campaign.

    Raises:
        ValueError: no trials, or one of them twice.
    """

    site: Site
    robot: RobotIdentity
    model: ModelIdentity
    protocol: ProtocolParameters
    seed: int
    trials: Sequence[PlannedTrial]
    """In the order in which they are to be run."""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    """What else results depend on, as the robot says."""
    name: str = ""
    """For people; the key does not depend on it."""

    def __post_init__(self) -> None:
        if not self.trials:
            raise ValueError("a campaign needs at least one trial")
        if len(set(self.trials)) != len(self.trials):
            raise ValueError("a trial is planned twice")

    @property
    def protocol_sha256(self) -> str:
        """Hash of the protocol's parameters."""
        return content_sha256(self.protocol.model_dump(mode="json"))

    @property
    def key(self) -> str:
        """Hash of the condition and the seed; the trials are the campaign's plan, and no part of it."""
        return content_sha256(
            [
                self.site.sha256,
                self.robot.sha256,
                self.model.sha256,
                self.protocol_sha256,
                dict(self.conditions),
                self.seed,
            ]
        )


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial as the database knows it."""

    id: int
    campaign_id: int
    goal: str
    start: int
    repetition: int


@dataclass(frozen=True, slots=True)
class OpenCampaign:
    """A campaign as somebody goes on with it: what was asked for now, out of all that was ever planned."""

    id: int
    key: str
    name: str
    seed: int
    resumed: bool
    """It was there before."""
    trials: tuple[Trial, ...]
    """Those that the plan asks for, in the plan's order; the campaign may have more."""
    added: int
    """How many of them were not planned before."""


@dataclass(frozen=True, slots=True)
class TrialStanding:
    """What has become of a trial, by its first episode that is not void."""

    trial: Trial
    episode_id: int | None
    state: EpisodeState | None
    """None while the trial is left."""
    success: bool | None
    """None unless it is judged."""
    here: bool
    """This process is at it, or has done it."""
    holder: str = ""
    """The process that is at it, or has done it, for people; empty while the trial is left."""


@dataclass(frozen=True, slots=True)
class CampaignStanding:
    """What has become of the trials that somebody asked for."""

    trials: tuple[TrialStanding, ...]

    @property
    def left(self) -> tuple[Trial, ...]:
        """Trials that nobody has done or is at, in the order of the plan."""
        return tuple(one.trial for one in self.trials if one.state is None)

    @property
    def elsewhere(self) -> tuple[TrialStanding, ...]:
        """Trials that another process is at: neither done nor left."""
        return tuple(one for one in self.trials if one.state in ACTIVE and not one.here)

    @property
    def awaiting(self) -> tuple[TrialStanding, ...]:
        """Trials that are done and await a person's judgement."""
        return tuple(one for one in self.trials if one.state is EpisodeState.AWAITING)

    @property
    def outcomes(self) -> tuple[bool, ...]:
        """For each trial that is done and judged, whether it succeeded."""
        return tuple(bool(one.success) for one in self.trials if one.state is EpisodeState.JUDGED)


class CampaignWriter:
    """What an open record writes and knows of campaigns; every method commits before it returns."""

    engine: Engine
    _process_id: int

    def find_or_create_campaign(self, plan: CampaignPlan) -> OpenCampaign:
        """Return the campaign of the plan's condition and seed; trials that it did not have yet are planned in it."""
        with transaction(self.engine) as connection:
            return find_or_create(connection, plan, self._process_id)

    def standing(self, campaign: OpenCampaign) -> CampaignStanding:
        """Say which of the trials that were asked for are done, are run elsewhere, or are left."""
        with transaction(reading(self.engine)) as connection:
            return standing(connection, campaign, self._process_id)


def find_or_create(connection: Connection, plan: CampaignPlan, process_id: int) -> OpenCampaign:
    """Return the campaign of the plan's condition and seed, with all that the plan asks for planned in it."""
    key = plan.key
    there = connection.execute(select(tables.Campaign.id).where(tables.Campaign.key == key)).scalar()
    if there is None:
        there = find_or_insert(
            connection,
            tables.Campaign,
            {
                **campaign_row(plan),
                "site_id": find_or_insert(connection, tables.Site, site_row(plan.site), "sha256"),
                "robot_id": find_or_insert(connection, tables.Robot, robot_row(plan.robot), "sha256"),
                "model_id": find_or_insert(connection, tables.Model, model_row(plan.model), "sha256"),
                "process_id": process_id,
            },
            "key",
        )
    # On a server this row is the lock by which two who extend one plan do it one after the other.
    campaign = connection.execute(select(tables.Campaign).where(tables.Campaign.id == there).with_for_update()).one()
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


def _trials(connection: Connection, campaign_id: int) -> dict[PlannedTrial, Trial]:
    rows = connection.execute(select(tables.Trial).where(tables.Trial.campaign_id == campaign_id))
    cells = ((row.id, PlannedTrial(row.goal, row.start, row.repetition)) for row in rows)
    return {cell: Trial(number, campaign_id, cell.goal, cell.start, cell.repetition) for number, cell in cells}


def extend_plan(connection: Connection, campaign_id: int, new: Sequence[PlannedTrial]) -> None:
    """Plan trials that a campaign does not have, in this order, after those that it has."""
    highest = connection.scalar(select(func.max(tables.Trial.rank)).where(tables.Trial.campaign_id == campaign_id))
    first = 0 if highest is None else highest + 1
    connection.execute(
        insert_if_absent(connection, tables.Trial, ["campaign_id", "goal", "start", "repetition"]),
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
        select(func.min(tables.Episode.id))
        .where(tables.Episode.trial_id == tables.Trial.id, tables.Episode.state != EpisodeState.VOID.value)
        .correlate(tables.Trial)
        .scalar_subquery()
    )
    rows = connection.execute(
        select(
            tables.Trial.id,
            tables.Episode.id,
            tables.Episode.state,
            SUCCESS,
            tables.Episode.process_id,
            tables.Process.pid,
            tables.Process.host,
        )
        .select_from(tables.Trial)
        .join(tables.Episode, tables.Episode.id == first)
        .join(tables.Process, tables.Process.id == tables.Episode.process_id)
        .outerjoin(tables.Verdict, tables.Verdict.id == standing_verdict_id(tables.Episode.id))
        .where(tables.Trial.campaign_id == campaign.id)
    )
    taken = {
        trial: (episode, EpisodeState(state), success, at == process_id, f"process {pid} on {host}")
        for trial, episode, state, success, at, pid, host in rows
    }
    free = (None, None, None, False)
    return CampaignStanding(tuple(TrialStanding(trial, *taken.get(trial.id, free)) for trial in campaign.trials))


def site_row(site: Site) -> Row:
    """Return the row of a site, whole."""
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


def model_row(model: ModelIdentity) -> Row:
    """Return the row of a model."""
    return {
        "sha256": model.sha256,
        "name": text(model.name),
        "weights_sha256": model.weights_sha256,
        "weights_label": text(model.weights_label),
        "files": dict(model.files),
        "code": dict(model.code),
        "settings": dict(model.settings),
        "goals": None if model.goals is None else sorted(model.goals),
        "sensors": sorted(model.sensors),
        "surveyed": model.surveyed,
    }


def campaign_row(plan: CampaignPlan) -> Row:
    """Return the row of a campaign, without the rows that it points to."""
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
