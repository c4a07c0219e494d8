"""Blinding: arms of a blinded study are shown as codes in every query.

Every query of a model's or campaign's name uses `MODEL_NAME` and `CAMPAIGN_NAME`. Other identifying data (weights,
settings, hashes, diagnostics, timing, error messages) are hidden as well. The database contains the real names, so the
blinding relies on not reading it directly.
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, Text, case, cast, func, literal, select
from sqlalchemy.orm import InstrumentedAttribute

from vsnbench.protocol.judge import EndReason
from vsnbench.results.reading.rows import EpisodeDetails, EpisodeProvenance
from vsnbench.results.schema.study_tables import Study, StudyArm
from vsnbench.results.schema.tables import Campaign, Episode, Model, Trial
from vsnbench.values.step import StepRecord, StepTimings

HIDDEN = "hidden while the study is blinded"
"""Replacement of texts that could identify a model."""
TELLING = frozenset({EndReason.MODEL_ERROR.value, EndReason.MODEL_LOST.value})
"""End reasons and event kinds with texts from the model."""


def _code(campaign_id: InstrumentedAttribute[int]) -> Any:
    return (
        select(literal("study").concat(cast(Study.id, Text)).concat("-").concat(StudyArm.code))
        .select_from(StudyArm)
        .join(Study, Study.id == StudyArm.study_id)
        .where(StudyArm.campaign_id == campaign_id, Study.blind.is_(True), Study.unblinded_at.is_(None))
    )


CODE: ColumnElement[str | None] = _code(Campaign.id).correlate(Campaign).scalar_subquery()
"""Code of a campaign that is an arm of a blinded study; NULL for others."""
MODEL_NAME: ColumnElement[str] = func.coalesce(CODE, Model.name)
CAMPAIGN_NAME: ColumnElement[str] = func.coalesce(CODE, Campaign.name)
CAMPAIGN_KEY: ColumnElement[str] = func.coalesce(CODE, Campaign.key)
ENDED_AT: ColumnElement[datetime | None] = case((CODE.is_(None), Episode.ended_at), else_=None)
"""End of an episode; NULL for a blinded arm, because the model's time is in it."""
HIDDEN_COLUMNS = frozenset(
    {"recorded_at", "stamp_s", "sense_s", "infer_s", "move_s", "ended_at", "wall_duration_s", "thinking_s"}
)
"""Columns of tables of steps and episodes that have no values for a blinded arm; `raw_action` is the action there."""


def blind_episodes(connection: Connection, numbers: Iterable[int] | None = None) -> frozenset[int]:
    """Return those of some episodes, by default of all, that belong to blinded arms."""
    query = (
        select(Episode.id)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .where(CODE.is_not(None))
    )
    if numbers is not None:
        query = query.where(Episode.id.in_(list(numbers)))
    return frozenset(connection.scalars(query))


def hide_step(step: StepRecord) -> StepRecord:
    """Return a step without the model's texts, diagnostics and timing.

    The times of two steps and of the motion between them would give the inference time.
    """
    return replace(
        step,
        raw_action=step.action.value,
        recorded_at=None,
        stamp_s=None,
        timings=StepTimings(),
        probabilities={},
        details={},
    )


def hide_steps(steps: Iterable[StepRecord]) -> tuple[StepRecord, ...]:
    """Return the hidden steps of an episode, each with the sum of the motions before it as its stamp, in seconds."""
    hidden, clock_s = [], 0.0
    for step in steps:
        hidden.append(replace(hide_step(step), stamp_s=clock_s))
        lasted_s = step.result.duration_s if step.result else 0.0
        clock_s += lasted_s if math.isfinite(lasted_s) else 0.0
    return tuple(hidden)


def hide_details(details: EpisodeDetails) -> EpisodeDetails:
    """Return an episode without identifying data."""
    return replace(
        details,
        error=HIDDEN if details.error and details.ended_with in TELLING else details.error,
        wall_duration_s=None,
        verdicts=tuple(
            replace(verdict, reason=verdict.end_reason) if verdict.end_reason in TELLING else verdict
            for verdict in details.verdicts
        ),
        events=tuple(replace(event, text=HIDDEN) if event.kind in TELLING else event for event in details.events),
        provenance=_hide_provenance(details.provenance),
    )


def _hide_provenance(given: EpisodeProvenance) -> EpisodeProvenance:
    return replace(
        given,
        platform={name: value for name, value in given.platform.items() if not name.startswith("model_")},
        weights_sha256="",
        weights_label="",
        model_files={},
        model_code={},
        model_settings={},
        campaign_key="",
    )
