"""Reads the conditions of a report, and the courses of episodes, from the record."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Engine, or_, select

from vsnbench.report.analysis.conditions import Condition, Selection, name_apart
from vsnbench.results.reading.blinding import blind_episodes
from vsnbench.results.reading.read_model import CODE, MODEL_NAME
from vsnbench.results.schema.engine import record_errors, to_json
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, ModelRow, RobotRow, SiteRow, StepRow, TrialRow
from vsnbench.results.writing.entries import SequenceLeg
from vsnbench.results.writing.lifecycle import EpisodeState
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import IMPORTED


def read_conditions(connection: Connection, chosen: Selection) -> tuple[tuple[Condition, ...], dict[int, int]]:
    """Return the conditions, and the condition number of each campaign id."""
    rows = connection.execute(
        select(CampaignRow.id, CampaignRow.protocol, CampaignRow.protocol_sha256)
        .add_columns(CampaignRow.conditions, CampaignRow.seed)
        .add_columns(ModelRow.id.label("model_id"), MODEL_NAME.label("model"))
        .add_columns(ModelRow.weights_label, ModelRow.weights_sha256, ModelRow.surveyed, ModelRow.settings)
        .add_columns(ModelRow.code.label("source"), CODE.label("code"), RobotRow.id.label("robot_id"))
        .add_columns(RobotRow.name.label("robot"), RobotRow.title, RobotRow.kind, RobotRow.simulated)
        .add_columns(RobotRow.profile["base"]["max_linear_m_s"].as_float().label("max_linear_m_s"))
        .add_columns(SiteRow.name.label("site"), SiteRow.sha256.label("site_sha256"))
        .join(ModelRow, ModelRow.id == CampaignRow.model_id)
        .join(RobotRow, RobotRow.id == CampaignRow.robot_id)
        .join(SiteRow, SiteRow.id == CampaignRow.site_id)
        .where(*_campaign_filter(chosen))
        .order_by(CampaignRow.id)
    ).all()
    surveys = _surveys(connection)
    groups: dict[tuple[object, ...], list[Any]] = {}
    for row in rows:
        # Arms of a blinded study are never pooled, because the other campaign would reveal the model.
        model = row.code or row.model_id
        key = (model, row.robot_id, row.site_sha256, row.protocol_sha256, to_json(row.conditions, in_order=True))
        groups.setdefault(key, []).append(row)
    conditions = []
    condition_of: dict[int, int] = {}
    for number, members in enumerate(groups.values(), start=1):
        first = members[0]
        condition_of |= {row.id: number for row in members}
        conditions.append(
            Condition(
                number=number,
                model=first.model,
                weights_label="" if first.code else first.weights_label,
                weights_sha256="" if first.code else first.weights_sha256,
                surveyed=first.surveyed and not first.code,
                robot=first.robot,
                robot_title=first.title,
                kind=first.kind,
                simulated=first.simulated,
                site=first.site,
                site_sha256=first.site_sha256,
                campaigns=tuple(row.id for row in members),
                seeds=tuple(row.seed for row in members),
                protocol=_in_order(first.protocol),
                settings={} if first.code else _in_order(first.settings),
                source={} if first.code else _in_order(first.source),
                conditions=_in_order(first.conditions),
                max_linear_m_s=first.max_linear_m_s or None,
                survey_sha256=surveys.get(first.site_sha256, ""),
                blind=bool(first.code),
            )
        )
    return name_apart(conditions), condition_of


def _surveys(connection: Connection) -> dict[str, str]:
    """Return the hash of each site that has a scan, with that of the same site without it."""
    has_scan = SiteRow.content["scan"]["sha256"].as_string().is_not(None)
    scanned = connection.execute(select(SiteRow.sha256, SiteRow.content).where(has_scan)).all()
    if not scanned:
        return {}
    from vsnbench.sites.scan import survey_sha256

    return {sha256: survey_sha256(content) for sha256, content in scanned}


def _in_order(settings: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return settings sorted by name, because PostgreSQL orders JSON keys differently."""
    return {
        name: _in_order(value) if isinstance(value, Mapping) else value
        for name, value in sorted((settings or {}).items())
    }


def _campaign_filter(chosen: Selection) -> list[Any]:
    valid = select(EpisodeRow.id).join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
    valid = valid.where(TrialRow.campaign_id == CampaignRow.id, EpisodeRow.state != EpisodeState.VOID.value)
    # An import with only void episodes was withdrawn.
    wanted: list[Any] = [or_(RobotRow.kind != IMPORTED, valid.correlate(CampaignRow).exists())]
    if chosen.models:
        wanted.append(MODEL_NAME.in_(chosen.models))
    if chosen.sites:
        wanted.append(SiteRow.name.in_(chosen.sites))
    if chosen.robots:
        wanted.append(RobotRow.name.in_(chosen.robots))
    if chosen.campaigns:
        wanted.append(CampaignRow.id.in_(chosen.campaigns))
    return wanted


@dataclass(frozen=True, slots=True)
class Course:
    """Poses of one episode in the site's frame: at the start, and after each action with a known pose."""

    poses: tuple[Pose, ...]
    blocked: tuple[bool, ...]
    """Whether the guard blocked the action, for every action."""
    touched: str
    """What the robot collided with; empty for nothing."""
    waiting_s: float | None = None
    """Time at rest without a path, waiting for an answer; None where the robot rests while the model thinks."""
    legs: tuple[tuple[SequenceLeg, tuple[Pose, ...]], ...] = ()
    """Goals of a sequence with the poses from where each was given; none for other goals, or if a pose is unknown."""


def read_courses(engine: Engine, numbers: Sequence[int]) -> dict[int, Course]:
    """Return the courses of some episodes, by number; none without steps.

    Poses in the site are used as recorded; without them odometry is added to the start pose. The waiting time would
    reveal the model of a blinded arm.
    """
    with record_errors(engine), engine.connect() as connection:
        found = connection.execute(
            select(
                *(StepRow.episode_id, EpisodeRow.start_x_m, EpisodeRow.start_y_m, EpisodeRow.start_heading_rad),
                *(StepRow.world_x_m, StepRow.world_y_m, StepRow.world_heading_rad),
                *(
                    StepRow.after_x_m,
                    StepRow.after_y_m,
                    StepRow.after_heading_rad,
                    StepRow.blocked,
                    StepRow.collision_touched,
                    StepRow.movement["waiting_s"].as_float(),
                ),
            )
            .join(EpisodeRow, EpisodeRow.id == StepRow.episode_id)
            .where(StepRow.episode_id.in_(numbers))
            .order_by(StepRow.episode_id, StepRow.number)
        ).all()
        sequences = select(EpisodeRow.id, EpisodeRow.legs).where(EpisodeRow.id.in_(numbers))
        legs = {row.id: row.legs for row in connection.execute(sequences) if row.legs}
        blind = blind_episodes(connection, numbers)
    grouped: dict[int, list[Any]] = {}
    for row in found:
        grouped.setdefault(row[0], []).append(row)
    return {number: _course(rows, legs.get(number, ()), is_blind=number in blind) for number, rows in grouped.items()}


def _course(rows: Sequence[Any], legs: Sequence[Mapping[str, Any]], *, is_blind: bool) -> Course:
    start = _pose(rows[0][1:4])
    poses = [start] if start else []
    for row in rows:
        if world := _pose(row[4:7]):
            poses.append(world)
        elif start and (after := _pose(row[7:10])):
            poses.append(start.compose(after))
    touched = next((row[11] for row in reversed(rows) if row[11]), "")
    waited = [row[12] for row in rows if row[12] is not None and not is_blind]
    waiting_s = math.fsum(waited) if waited else None
    parts = _poses_of_legs(legs, tuple(poses), len(rows))
    return Course(tuple(poses), tuple(bool(row[10]) for row in rows), touched, waiting_s, parts)


def _poses_of_legs(
    recorded: Sequence[Mapping[str, Any]], poses: tuple[Pose, ...], steps: int
) -> tuple[tuple[SequenceLeg, tuple[Pose, ...]], ...]:
    """Return the goals of a sequence with their poses: each step of such an episode is an action of one goal."""
    legs, parts, first = [SequenceLeg(**leg) for leg in recorded], [], 0
    if sum(leg.actions for leg in legs) != steps or len(poses) != steps + 1:
        return ()
    for leg in legs:
        parts.append((leg, poses[first : first + leg.actions + 1]))
        first += leg.actions
    return tuple(parts)


def _pose(values: Sequence[float | None]) -> Pose | None:
    """Return a recorded pose; None if a number is missing or, from another writer, infinite."""
    known = [value for value in values if value is not None and math.isfinite(value)]
    return Pose(*known) if len(known) == len(values) else None
