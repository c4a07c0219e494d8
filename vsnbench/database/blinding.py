"""The one place that gives models their names: while a study is blind its arms have codes, whoever asks.

Every query that reads a model's or a campaign's name takes `MODEL_NAME` and `CAMPAIGN_NAME` from here, and whatever
else could tell which model it was (weights, settings, hashes, diagnostics, timing, the words of its errors) is hidden
with it. The database keeps the truth, and a person with SQL can look: this is honour, not cryptography.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from sqlalchemy import ColumnElement, Connection, Text, case, cast, func, literal, select
from sqlalchemy.orm import InstrumentedAttribute

from vsnbench.database.read_shapes import EpisodeDetails, EpisodeProvenance, RecordedEvent
from vsnbench.database.study_tables import Study, StudyArm
from vsnbench.database.tables import Campaign, Episode, Model, Trial
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.step_record import StepRecord

HIDDEN = "hidden while the study is blind"
"""What stands in place of words that could tell a model."""
TELLING = frozenset({EndReason.MODEL_ERROR.value, EndReason.MODEL_LOST.value})
"""Ends, and kinds of events, whose words are the model's own."""


def arm_code(study_id: int, letter: str) -> str:
    """Return what an arm is called in the record's lists while it is blind: `study1-A`."""
    return f"study{study_id}-{letter}"


def _code(campaign_id: InstrumentedAttribute[int]) -> Any:
    return (
        select(literal("study").concat(cast(Study.id, Text)).concat("-").concat(StudyArm.code))
        .select_from(StudyArm)
        .join(Study, Study.id == StudyArm.study_id)
        .where(StudyArm.campaign_id == campaign_id, Study.blind.is_(True), Study.unblinded_at.is_(None))
    )


CODE: ColumnElement[str | None] = _code(Campaign.id).correlate(Campaign).scalar_subquery()
"""The code of a campaign that is an arm of a blind study; NULL for every other."""
MODEL_NAME: ColumnElement[str] = func.coalesce(CODE, Model.name)
CAMPAIGN_NAME: ColumnElement[str] = func.coalesce(CODE, Campaign.name)
CAMPAIGN_KEY: ColumnElement[str] = func.coalesce(CODE, Campaign.key)


def unless_blind(column: Any) -> ColumnElement[Any]:
    """Return the column, NULL where a code stands for the model."""
    return case((CODE.is_(None), column))


def blind_episodes(connection: Connection, numbers: Iterable[int]) -> frozenset[int]:
    """Return which of these episodes are of a blind arm."""
    query = (
        select(Episode.id)
        .join(Trial, Trial.id == Episode.trial_id)
        .join(Campaign, Campaign.id == Trial.campaign_id)
        .where(Episode.id.in_(list(numbers)), CODE.is_not(None))
    )
    return frozenset(connection.scalars(query))


def hide_step(step: StepRecord) -> StepRecord:
    """Return a step without the model's own words, diagnostics and timing."""
    timings = replace(step.timings, infer_s=None)
    return replace(step, raw_action=step.action.value, timings=timings, probabilities={}, details={})


def hide_steps(steps: Iterable[StepRecord]) -> tuple[StepRecord, ...]:
    """Return steps without what tells their model."""
    return tuple(map(hide_step, steps))


def hide_details(details: EpisodeDetails) -> EpisodeDetails:
    """Return an episode without what tells its model."""
    return replace(
        details,
        error=HIDDEN if details.error and details.ended_with in TELLING else details.error,
        wall_duration_s=None,
        verdicts=tuple(
            replace(one, reason=one.end_reason) if one.end_reason in TELLING else one for one in details.verdicts
        ),
        events=tuple(map(_hide_event, details.events)),
        provenance=_hide_provenance(details.provenance),
    )


def _hide_event(event: RecordedEvent) -> RecordedEvent:
    return replace(event, text=HIDDEN) if event.kind in TELLING else event


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
