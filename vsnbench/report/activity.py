"""Counts what robots did in the steps and sessions of a record; the counting is the database's."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, Engine, case, func, select
from sqlalchemy.orm import aliased

from vsnbench.database.engine import record_errors
from vsnbench.database.interventions import INTERVENTION, aborted_unwritten
from vsnbench.database.tables import Campaign, Episode, Event, Robot, Step, Trial, Verdict
from vsnbench.database.validity import counts, standing_verdict_id
from vsnbench.protocol.judge import EndReason
from vsnbench.report.record import Record

FAILURES = (EndReason.MOTION_FAILED, EndReason.SENSOR_LOST, EndReason.MODEL_ERROR, EndReason.INTERRUPTED)
"""Ends that are the system's fault: neither the policy's nor a person's wish."""


@dataclass(frozen=True, slots=True)
class ActionCount:
    """How often, under one condition, the model said one thing and one action became of it."""

    condition: int
    raw_action: str
    """The model's own word."""
    action: str
    """What was asked of the robot."""
    blocked: bool
    """The depth guard refused it: counted, not executed."""
    steps: int


@dataclass(frozen=True, slots=True)
class RobotActivity:
    """How one robot did over all its attempts, void ones too (paper, Table 6)."""

    robot: str
    title: str
    simulated: bool
    episodes: int
    driving_s: float
    """Sum of the episodes' durations on the robot's clock."""
    elapsed_s: float
    """From the first start to the last end of each process, summed: what a person would have waited."""
    path_m: float
    failures: int
    collisions: int
    interventions: int
    """As `vsnbench.database.interventions` defines them; none where the robot is simulated."""

    @property
    def failures_per_km(self) -> float:
        """Failures of the system a kilometre; NaN before the first metre."""
        return self.failures / (self.path_m / 1000) if self.path_m > 0 else float("nan")


@dataclass(frozen=True, slots=True)
class Activity:
    """What was counted."""

    actions: tuple[ActionCount, ...]
    robots: tuple[RobotActivity, ...]


def read_activity(engine: Engine, record: Record) -> Activity:
    """Count actions and distances of the campaigns that a record holds.

    Raises:
        RecordError: the database cannot be used.
    """
    condition_of = {campaign: one.number for one in record.conditions for campaign in one.campaigns}
    goals = sorted({str(goal) for goal in record.planned["goal"]})
    with record_errors(engine), engine.connect() as connection:
        return Activity(
            actions=_actions(connection, condition_of, goals), robots=_robots(connection, list(condition_of), goals)
        )


def _actions(connection: Connection, condition_of: dict[int, int], goals: Sequence[str]) -> tuple[ActionCount, ...]:
    # Summed up within each episode first: the index on the actions is read in its own order, without sorting.
    within = (
        select(Step.episode_id, Step.raw_action, Step.action, Step.blocked, func.count().label("steps"))
        .group_by(Step.episode_id, Step.raw_action, Step.action, Step.blocked)
        .subquery()
    )
    rows = connection.execute(
        select(Trial.campaign_id, within.c.raw_action, within.c.action, within.c.blocked, func.sum(within.c.steps))
        .select_from(within)
        .join(Episode, Episode.id == within.c.episode_id)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Verdict, Verdict.id == standing_verdict_id(Episode.id))
        .where(Trial.campaign_id.in_(list(condition_of)), Trial.goal.in_(goals), counts(Episode, Verdict))
        .group_by(Trial.campaign_id, within.c.raw_action, within.c.action, within.c.blocked)
    )
    sums: dict[tuple[int, str, str, bool], int] = {}
    for campaign, raw_action, action, blocked, steps in rows:
        key = (condition_of[campaign], raw_action, action, bool(blocked))
        sums[key] = sums.get(key, 0) + int(steps)
    return tuple(ActionCount(*key, steps) for key, steps in sorted(sums.items()))


def _robots(connection: Connection, campaigns: Sequence[int], goals: Sequence[str]) -> tuple[RobotActivity, ...]:
    verdict = aliased(Verdict)
    reason = func.coalesce(verdict.end_reason, Episode.end_reason)

    def ended(*reasons: EndReason) -> ColumnElement[int]:
        return func.sum(case((reason.in_([each.value for each in reasons]), 1), else_=0))

    by_process = (
        select(
            Robot.id.label("robot"),
            Episode.process_id,
            func.count().label("episodes"),
            func.coalesce(func.sum(Episode.duration_s), 0.0).label("driving_s"),
            func.coalesce(func.sum(Episode.path_length_m), 0.0).label("path_m"),
            func.min(Episode.started_at, type_=Episode.started_at.type).label("first"),
            func.max(Episode.ended_at, type_=Episode.ended_at.type).label("last"),
            ended(*FAILURES).label("failures"),
            ended(EndReason.COLLISION).label("collisions"),
            func.sum(case((aborted_unwritten(Episode, reason), 1), else_=0)).label("aborted"),
        )
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .join(Robot, Robot.id == Campaign.robot_id)
        .outerjoin(verdict, verdict.id == standing_verdict_id(Episode.id))
        .where(Campaign.id.in_(campaigns), Trial.goal.in_(goals), Episode.end_reason.is_not(None))
        .group_by(Robot.id, Episode.process_id)
    )
    rows = connection.execute(by_process).all()
    helped = {
        row.robot_id: row.times
        for row in connection.execute(
            select(Campaign.robot_id, func.count().label("times"))
            .select_from(Event)
            .join(Episode, Episode.id == Event.episode_id)
            .join(Trial, Trial.id == Episode.trial_id)
            .join(Campaign, Campaign.id == Trial.campaign_id)
            .where(Campaign.id.in_(campaigns), Trial.goal.in_(goals), Event.kind == INTERVENTION)
            .group_by(Campaign.robot_id)
        )
    }
    robots = connection.execute(select(Robot.id, Robot.name, Robot.title, Robot.simulated).order_by(Robot.id)).all()
    activity = []
    for robot in robots:
        sessions = [row for row in rows if row.robot == robot.id]
        if not sessions:
            continue
        activity.append(
            RobotActivity(
                robot=robot.name,
                title=robot.title,
                simulated=robot.simulated,
                episodes=sum(row.episodes for row in sessions),
                driving_s=sum(row.driving_s for row in sessions),
                elapsed_s=sum((row.last - row.first).total_seconds() for row in sessions),
                path_m=sum(row.path_m for row in sessions),
                failures=sum(row.failures for row in sessions),
                collisions=sum(row.collisions for row in sessions),
                interventions=helped.get(robot.id, 0)
                + (0 if robot.simulated else sum(row.aborted for row in sessions)),
            )
        )
    return tuple(activity)
