"""Counts what models chose and robots did: actions in the steps, which the database counts, distances by session."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, Engine, func, select

from vsnbench.database.engine import record_errors
from vsnbench.database.episode_entries import INTERVENTION
from vsnbench.database.lifecycle import EpisodeState
from vsnbench.database.read_model import COUNTS, RUNNING
from vsnbench.database.tables import Campaign, Episode, Event, Robot, Step, Trial
from vsnbench.protocol.judge import EndReason
from vsnbench.report.conditions import read_conditions
from vsnbench.report.failures import Failures
from vsnbench.report.judgements import Judgements
from vsnbench.report.record import Record, Selection, trial_filter

if TYPE_CHECKING:
    import pandas as pd

FAILURES = (
    EndReason.MOTION_FAILED,
    EndReason.SENSOR_LOST,
    EndReason.MODEL_ERROR,
    EndReason.MODEL_LOST,
    EndReason.INTERRUPTED,
)
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
    """From the first start to the last end of each process, what ran at once counted once: what a person waited."""
    path_m: float
    failures: int
    collisions: int
    interventions: int
    """As `count_interventions` counts them; none where the robot is simulated: whoever ends one ends a process."""

    @property
    def failures_per_km(self) -> float:
        """Failures of the system a kilometre; NaN before the first metre."""
        return self.failures / (self.path_m / 1000) if self.path_m > 0 else float("nan")


@dataclass(frozen=True, slots=True)
class Activity:
    """What was counted."""

    actions: tuple[ActionCount, ...]
    robots: tuple[RobotActivity, ...]
    failures: tuple[Failures, ...] = ()
    judgements: tuple[Judgements, ...] = ()


def read_actions(engine: Engine, selection: Selection) -> tuple[ActionCount, ...]:
    """Count the actions of the episodes that count.

    Raises:
        RecordError: the database cannot be used.
    """
    with record_errors(engine), engine.connect() as connection:
        conditions, condition_of = read_conditions(connection, selection)
        # What a model chooses tells which it is: of a blind arm no actions are counted.
        seen = {one.number for one in conditions if not one.blind}
        condition_of = {campaign: number for campaign, number in condition_of.items() if number in seen}
        if not condition_of:
            return ()
        return _actions(connection, condition_of, trial_filter(selection, condition_of))


def _actions(connection: Connection, condition_of: dict[int, int], trials: Sequence[Any]) -> tuple[ActionCount, ...]:
    # Which episodes count is settled once for each: the offset keeps the database from asking again for every action.
    counted = (
        select(Episode.id, Trial.campaign_id)
        .join(Trial, Trial.id == Episode.trial_id)
        .where(*trials, COUNTS, Episode.state == EpisodeState.JUDGED.value)
        .offset(0)
        .subquery()
    )
    # Summed up within each episode first: the index on the actions is read in its own order, without sorting.
    within = (
        select(Step.episode_id, Step.raw_action, Step.action, Step.blocked, func.count().label("steps"))
        .group_by(Step.episode_id, Step.raw_action, Step.action, Step.blocked)
        .subquery()
    )
    # Joined from the left, so that this order is kept; episodes that do not count come without a campaign.
    rows = connection.execute(
        select(counted.c.campaign_id, within.c.raw_action, within.c.action, within.c.blocked, func.sum(within.c.steps))
        .outerjoin(counted, counted.c.id == within.c.episode_id)
        .group_by(counted.c.campaign_id, within.c.raw_action, within.c.action, within.c.blocked)
    )
    sums: dict[tuple[int, str, str, bool], int] = {}
    for campaign, raw_action, action, blocked, steps in rows:
        if campaign not in condition_of:
            continue
        key = (condition_of[campaign], raw_action, action, bool(blocked))
        sums[key] = sums.get(key, 0) + int(steps)
    return tuple(ActionCount(*key, steps) for key, steps in sorted(sums.items()))


def read_robots(engine: Engine, record: Record) -> tuple[RobotActivity, ...]:
    """Sum up what each robot did in a record, in the order of the robots.

    Raises:
        RecordError: the database cannot be used.
    """
    campaigns = [campaign for one in record.conditions for campaign in one.campaigns]
    with record_errors(engine), engine.connect() as connection:
        robots = connection.execute(
            select(Robot.id, Robot.name, Robot.title, Robot.simulated, Campaign.id)
            .join(Campaign, Campaign.robot_id == Robot.id)
            .where(Campaign.id.in_(campaigns))
            .order_by(Robot.id, Campaign.id)
        ).all()
        written = _written(connection, campaigns)
    own: dict[tuple[int, str, str, bool], list[int]] = {}
    for number, name, title, simulated, campaign in robots:
        own.setdefault((number, name, title, simulated), []).append(campaign)
    activity = []
    for (_, name, title, simulated), mine in own.items():
        rows = record.episodes[record.episodes["campaign"].isin(mine) & (record.episodes["state"] != RUNNING)]
        if not rows.empty:
            aborted = () if simulated else rows.loc[rows["end_reason"] == EndReason.ABORTED.value, "episode"]
            helped = rows["episode"].map(count_interventions(written, aborted)).sum()
            activity.append(_robot_activity(name, title, simulated=simulated, rows=rows, helped=int(helped)))
    return tuple(activity)


def count_interventions(written: Mapping[int, int], aborted: Iterable[int]) -> dict[int, int]:
    """Return how often a person intervened, by the number of the episode.

    An aborted episode without an event counts as one: a person made it void afterwards, or the record is older than
    the events. With one it is counted by its events alone, so that an abort never counts twice.

    Args:
        written: events of kind `INTERVENTION` by episode.
        aborted: episodes of real robots whose standing end reason is `aborted`.
    """
    return dict.fromkeys(aborted, 1) | dict(written)


def _written(connection: Connection, campaigns: Sequence[int]) -> dict[int, int]:
    """Return the episodes of these campaigns with events that say that a person intervened, and how many."""
    rows = connection.execute(
        select(Event.episode_id, func.count())
        .join(Episode, Episode.id == Event.episode_id)
        .join(Trial, Trial.id == Episode.trial_id)
        .where(Event.kind == INTERVENTION, Trial.campaign_id.in_(campaigns))
        .group_by(Event.episode_id)
    )
    return {episode: times for episode, times in rows if episode is not None}


def _robot_activity(name: str, title: str, *, simulated: bool, rows: "pd.DataFrame", helped: int) -> RobotActivity:
    sessions = rows.groupby("process")
    ends = rows["end_reason"]
    return RobotActivity(
        robot=name,
        title=title,
        simulated=simulated,
        episodes=len(rows),
        driving_s=_total(rows["duration_s"]),
        elapsed_s=_waited_s(sessions["started_at"].min(), sessions["ended_at"].max()),
        path_m=_total(rows["path_length_m"]),
        failures=int(ends.isin([reason.value for reason in FAILURES]).sum()),
        collisions=int((ends == EndReason.COLLISION.value).sum()),
        interventions=helped,
    )


def _total(numbers: "pd.Series[float]") -> float:
    """Return the sum of what is known, to the bit the same whatever the order in which the episodes were run."""
    return math.fsum(numbers.dropna())


def _waited_s(begins: "pd.Series[Any]", ends: "pd.Series[Any]") -> float:
    """Return how long at least one of the processes was at it, seconds."""
    waited_s, until = 0.0, None
    for began, ended in sorted(zip(begins, ends, strict=True)):
        begins_anew = began if until is None else max(began, until)
        if ended > begins_anew:
            waited_s += (ended - begins_anew).total_seconds()
        until = ended if until is None else max(ended, until)
    return waited_s
