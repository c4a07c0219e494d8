"""Writes small records through the journal, as a run does, for tests of readers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

from sqlalchemy import Engine

from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.summary import Group
from vsnbench.report.tables.success import SUMMARY
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.schema.engine import open_engine
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import Site, load_site
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.model.card import ModelCard
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import RobotIdentity
from vsnbench.values.step import StepRecord

MORNING = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)


@dataclass(frozen=True)
class Attempt:
    """An episode to write."""

    goal: str = "chair"
    start: int = 1
    repetition: int = 1
    success: bool | None = True
    end_reason: EndReason = EndReason.STOP
    actions: int = 10
    distance_m: float | None = 0.5
    in_sight: bool = True
    path_m: float | None = 2.0
    shortest_m: float | None = 2.0
    remaining_m: float | None = 0.0
    duration_s: float | None = 30.0
    steps: Sequence[StepRecord] = ()
    judged: bool = True
    proposed: bool = False
    """Whether the protocol's verdict awaits a person's judgement."""
    final: Pose | None = None
    begins: Pose = field(default_factory=lambda: Pose(1.0, 1.0))
    operator: str = ""
    """Name of the operator."""


@cache
def apartment() -> Site:
    """Return the embedded apartment, cached for all records."""
    return load_site("apartment")


@dataclass(frozen=True)
class Lab:
    """A record in a directory, and the common settings of its campaigns."""

    directory: Path
    site: Site = field(default_factory=apartment)

    @property
    def url(self) -> str:
        return sqlite_url(self.directory / "vsnbench.db")

    def engine(self) -> Engine:
        """Return an engine on the record, for reading."""
        return open_engine(self.url, read_only=True)

    def journal(self) -> Journal:
        return Journal.open(self.url)

    def write(  # noqa: PLR0913 - every test varies another one
        self,
        attempts: Sequence[Attempt],
        *,
        model: str = "vlv",
        weights_label: str = "",
        trials: Sequence[Trial] | None = None,
        simulated: bool = True,
        robot: str = "turtlebot2",
        protocol: ProtocolParameters | None = None,
        surveyed: bool = False,
        seed: int = 0,
        settings: Mapping[str, Any] | None = None,
        conditions: Mapping[str, Any] | None = None,
    ) -> list[int]:
        """Write a campaign with attempts in order, and return their episode numbers."""
        planned = trials or list(dict.fromkeys(Trial(a.goal, a.start, a.repetition) for a in attempts))
        plan = CampaignPlan(
            site=self.site,
            robot=RobotIdentity(load_profile(robot), "simulated" if simulated else "ros1", simulated),
            model=ModelCard(model, weights_label=weights_label, surveyed=surveyed, settings=settings or {}),
            protocol=protocol or ProtocolParameters(),
            seed=seed,
            trials=planned,
            conditions=conditions or {},
        )
        numbers = []
        with self.journal() as journal:
            campaign = journal.find_or_create_campaign(plan)
            trial_of = {(t.goal, t.start, t.repetition): t for t in campaign.trials}
            for place, attempt in enumerate(attempts):
                trial = trial_of[attempt.goal, attempt.start, attempt.repetition]
                numbers.append(_write_attempt(journal, trial, attempt, MORNING + timedelta(minutes=place)))
        return numbers


def _write_attempt(journal: Journal, trial: Trial, attempt: Attempt, at: datetime) -> int:
    handle = journal.claim_next(trial.campaign_id, [trial.id])
    assert handle is not None, "this trial already has a result"
    if attempt.operator:
        journal.set_operator(handle.id, attempt.operator)
    journal.place(handle.id, Fix(attempt.begins, PoseSource.SIMULATED))
    journal.begin(handle.id, EpisodeBegin(attempt.shortest_m, started_at=at))
    for step in attempt.steps:
        journal.append_step(handle.id, step)
    distance = None
    if attempt.distance_m is not None:
        distance = GoalDistance(attempt.distance_m, PoseSource.SIMULATED, "chair-1", attempt.in_sight)
    verdict = Verdict(attempt.end_reason, attempt.success, "as the test says", distance)
    journal.end_episode(
        handle.id,
        EpisodeEnd(
            verdict if attempt.judged else Verdict(attempt.end_reason, None, "not judged yet"),
            attempt.actions,
            proposed=attempt.proposed,
            unjudged=not attempt.judged,
            path_m=attempt.path_m,
            remaining_m=attempt.remaining_m,
            duration_s=attempt.duration_s,
            wall_duration_s=attempt.duration_s,
            final=Fix(attempt.final, PoseSource.SIMULATED) if attempt.final else None,
            ended_at=at + timedelta(seconds=attempt.duration_s or 0),
        ),
    )
    return handle.id


def void(goal: str = "chair", start: int = 1, reason: EndReason = EndReason.MOTION_FAILED) -> Attempt:
    """Return an attempt without a result."""
    return Attempt(goal=goal, start=start, success=None, end_reason=reason, distance_m=None)


def step(number: int, action: Action, raw_action: str = "", *, x_m: float = 0.0, blocked: bool = False) -> StepRecord:
    """Return a step that ends at (x, 1) in the site."""
    return StepRecord(
        number=number,
        action=action,
        raw_action=raw_action,
        result=None if blocked else MotionResult(completed=True, displacement_m=0.25, pose=Pose(x_m, 0.0)),
        observed=Pose(x_m, 0.0),
        world=Fix(Pose(1.0 + x_m, 1.0), PoseSource.SIMULATED),
    )


def measured(group: Group, key: str) -> Any:
    """Return the value of a measure of the success table."""
    return SUMMARY.named(key).value(group)
