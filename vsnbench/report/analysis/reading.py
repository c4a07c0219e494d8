"""Reads the conditions of a report from the record."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, or_, select

from vsnbench.report.analysis.conditions import Condition, Selection, name_apart
from vsnbench.results.reading.read_model import CODE, MODEL_NAME
from vsnbench.results.schema.engine import to_json
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, ModelRow, RobotRow, SiteRow, TrialRow
from vsnbench.results.writing.lifecycle import EpisodeState
from vsnbench.sites.scan import survey_sha256
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
    scanned = select(SiteRow.sha256, SiteRow.content).where(SiteRow.content["scan"]["sha256"].as_string().is_not(None))
    surveys = {sha256: survey_sha256(content) for sha256, content in connection.execute(scanned)}
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
