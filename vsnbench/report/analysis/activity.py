"""Counts of the models' actions and of the robots' driving time, distance, failures and interventions."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, Engine, func, select

from vsnbench.protocol.execution import STACK
from vsnbench.protocol.judge import MODEL_FAILURES, ROBOT_FAILURES, EndReason
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.episodes_frame import ReportData, trial_filter
from vsnbench.report.analysis.reading import read_conditions
from vsnbench.results.reading.read_model import COUNTS, RUNNING, UNJUDGED
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.schema.row_encoding import AT_STOP
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, EventRow, RobotRow, StepRow, TrialRow
from vsnbench.results.writing.entries import INTERVENTION

if TYPE_CHECKING:
    import pandas as pd

FAILURES = (*ROBOT_FAILURES, *MODEL_FAILURES, EndReason.INTERRUPTED)
"""End reasons that are failures of the system rather than of the policy or an operator's decision."""


_LEAST_PATH_M = 1.0
"""Shortest path whose drift per metre tells about the odometry."""

Rows = Sequence[Mapping[str, Any]]
_KEYS = ("condition", "raw_action", "action", "blocked", "steps")


@dataclass(frozen=True, slots=True)
class Activity:
    """Counts of a report: rows of the measures in parentheses, by the measures' keys."""

    actions: Rows
    """Steps of a condition with the same raw action, executed action and guard result (`tables.activity.ACTIONS`)."""
    robots: Rows
    """All attempts of a robot, including void ones (`tables.activity.ROBOTS`; paper, Table 6)."""
    failures: Rows = ()
    """Causes of a condition's failures (`tables.failures.FAILURES`)."""
    judgements: Rows = ()
    """Operators' judgements of a condition (`tables.failures.JUDGEMENTS`)."""
    courses: Rows = ()
    """Courses of a condition (`tables.progress.COURSES`)."""
    stops: Rows = ()
    """Poses of a robot that were measured after STOP (`tables.activity.ODOMETRY`)."""


def read_actions(engine: Engine, selection: Selection) -> Rows:
    """Count the actions of the counted episodes."""
    with record_errors(engine), engine.connect() as connection:
        conditions, condition_of = read_conditions(connection, selection)
        # A model can be recognized by its actions: blinded arms are left out. A stack has none.
        seen = {condition.number for condition in conditions if not condition.blind and condition.execution != STACK}
        condition_of = {campaign: number for campaign, number in condition_of.items() if number in seen}
        if not condition_of:
            return ()
        return _actions(connection, condition_of, trial_filter(selection, condition_of))


def _actions(connection: Connection, condition_of: dict[int, int], trials: Sequence[Any]) -> Rows:
    # The offset makes the database evaluate once per episode whether it counts, instead of once per action.
    counted = (
        select(EpisodeRow.id, TrialRow.campaign_id)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .where(*trials, COUNTS)
        .offset(0)
        .subquery()
    )
    # Group within each episode first: the index on the actions then needs no sorting.
    within = (
        select(StepRow.episode_id, StepRow.raw_action, StepRow.action, StepRow.blocked, func.count().label("steps"))
        .group_by(StepRow.episode_id, StepRow.raw_action, StepRow.action, StepRow.blocked)
        .subquery()
    )
    # The outer join keeps that order; episodes that do not count have no campaign.
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
    return tuple(dict(zip(_KEYS, (*key, steps), strict=True)) for key, steps in sorted(sums.items()))


def read_robots(engine: Engine, record: ReportData) -> Rows:
    """Return the activity of each robot of a record, in the order of the robots."""
    campaigns = [campaign for condition in record.conditions for campaign in condition.campaigns]
    with record_errors(engine), engine.connect() as connection:
        robots = connection.execute(
            select(RobotRow.id, RobotRow.name, RobotRow.title, RobotRow.simulated, CampaignRow.id)
            .join(CampaignRow, CampaignRow.robot_id == RobotRow.id)
            .where(CampaignRow.id.in_(campaigns))
            .order_by(RobotRow.id, CampaignRow.id)
        ).all()
        written = interventions(connection, campaigns)
    own: dict[tuple[int, str, str, bool], list[int]] = {}
    for number, name, title, simulated, campaign in robots:
        own.setdefault((number, name, title, simulated), []).append(campaign)
    activity = []
    for (_, name, title, simulated), mine in own.items():
        rows = record.episodes[record.episodes["campaign"].isin(mine) & (record.episodes["state"] != RUNNING)]
        if not rows.empty:
            aborted = () if simulated else rows.loc[rows["end_reason"] == EndReason.ABORTED.value, "episode"]
            # An aborted episode without an event counts as one intervention: an operator voided it later, or the
            # record predates events. Otherwise only events count, so that an abort is not counted twice.
            helped = rows["episode"].map(dict.fromkeys(aborted, 1) | written).sum()
            activity.append(_robot_activity(name, title, simulated=simulated, rows=rows, helped=int(helped)))
    return tuple(activity)


def interventions(connection: Connection, campaigns: Sequence[int]) -> dict[int, int]:
    """Return the number of recorded interventions by episode of these campaigns; only episodes that have some."""
    rows = connection.execute(
        select(EventRow.episode_id, func.count())
        .join(EpisodeRow, EpisodeRow.id == EventRow.episode_id)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .where(EventRow.kind == INTERVENTION, TrialRow.campaign_id.in_(campaigns))
        .group_by(EventRow.episode_id)
    )
    return {episode: times for episode, times in rows if episode is not None}


def _robot_activity(name: str, title: str, *, simulated: bool, rows: "pd.DataFrame", helped: int) -> dict[str, Any]:
    sessions = rows.groupby("process")
    ends = rows["end_reason"]
    return {
        "robot": name,
        "title": title,
        "simulated": simulated,
        "episodes": len(rows),
        "driving_s": _total(rows["duration_s"]),
        "elapsed_s": _waited_s(sessions["started_at"].min(), sessions["ended_at"].max()),
        "path_m": _total(rows["path_m"]),
        "failures": int(ends.isin([reason.value for reason in FAILURES]).sum()),
        "collisions": int((ends == EndReason.COLLISION.value).sum()),
        "interventions": helped,
    }


def read_stops(engine: Engine, record: ReportData) -> Rows:
    """Return what the poses measured after STOP say about the odometry of each robot that has any, by name."""
    columns = (Placement.episode_id, Placement.determined, Placement.ahead_m, Placement.left_m, Placement.turn_rad)
    query = select(*columns, Placement.verdicts_differ).where(Placement.moment == AT_STOP).order_by(columns[0])
    with record_errors(engine), engine.connect() as connection:
        measured = connection.execute(query).all()
    if not measured:
        return ()
    rows = record.episodes[record.episodes["episode"].isin([row.episode_id for row in measured])]
    columns_of = (rows[name].tolist() for name in ("episode", "condition", "path_m", "state"))
    known = {episode: found for episode, *found in zip(*columns_of, strict=True)}
    robots = {
        condition.number: (condition.robot, condition.robot_title, condition.simulated)
        for condition in record.conditions
    }
    found: dict[tuple[str, str, bool], dict[str, Any]] = {}
    for row in measured:
        if row.episode_id not in known:
            continue
        condition, path_m, state = known[row.episode_id]
        name, title, simulated = robots[condition]
        new = {"robot": name, "title": title, "simulated": simulated, "stops": 0, "unjudged": 0}
        lists: dict[str, list[float]] = {key: [] for key in ("differing", "drift_m", "drift_per_m", "turn_per_m")}
        robot = found.setdefault(robots[condition], {**new, **lists})
        robot["stops"] += 1
        if row.verdicts_differ:
            robot["differing"].append(row.episode_id)
            robot["unjudged"] += state == UNJUDGED
        if row.determined:
            drift_m = math.hypot(row.ahead_m, row.left_m)
            robot["drift_m"].append(drift_m)
            if path_m >= _LEAST_PATH_M:  # False for NaN
                robot["drift_per_m"].append(drift_m / path_m)
                robot["turn_per_m"].append(abs(row.turn_rad) / path_m)
    return [found[key] for key in sorted(found)]


def _total(numbers: "pd.Series[float]") -> float:
    """Return the sum of the known values, independent of their order."""
    return math.fsum(numbers.dropna())


def _waited_s(begins: "pd.Series[Any]", ends: "pd.Series[Any]") -> float:
    """Return the time during which at least one process ran, in seconds."""
    waited_s, until = 0.0, None
    for began, ended in sorted(zip(begins, ends, strict=True)):
        begins_anew = began if until is None else max(began, until)
        if ended > begins_anew:
            waited_s += (ended - begins_anew).total_seconds()
        until = ended if until is None else max(ended, until)
    return waited_s
