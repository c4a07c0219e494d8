"""Blinding: what a query does not return of the arms of a blinded study.

Names are codes (`read_model.CODE`). Other identifying data (weights, settings, hashes, diagnostics, timing, error
messages) are hidden as their declarations say (`vsnbench.results.model`). The database contains the real names, so the
blinding relies on not reading it directly.
"""

import math
from collections.abc import Iterable
from dataclasses import replace

from sqlalchemy import Connection, select

from vsnbench.results.fields import without_hidden
from vsnbench.results.model import EPISODE, EpisodeProvenance, EpisodeRecord
from vsnbench.results.reading.read_model import CODE, HIDDEN, TELLING
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, TrialRow
from vsnbench.results.step_fields import STEP
from vsnbench.values.step import StepRecord, StepTimings

HIDDEN_COLUMNS = EPISODE.hidden | STEP.hidden - {"raw_action"}
"""Columns of tables of steps and episodes that have no values for a blinded arm; `raw_action` is the action there."""


def blind_episodes(connection: Connection, numbers: Iterable[int] | None = None) -> frozenset[int]:
    """Return those of some episodes, by default of all, that belong to blinded arms."""
    query = (
        select(EpisodeRow.id)
        .join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
        .join(CampaignRow, CampaignRow.id == TrialRow.campaign_id)
        .where(CODE.is_not(None))
    )
    if numbers is not None:
        query = query.where(EpisodeRow.id.in_(list(numbers)))
    return frozenset(connection.scalars(query))


def hide_step(step: StepRecord) -> StepRecord:
    """Return a step without the model's texts, diagnostics and timing.

    The times of two steps and of the motion between them would give the inference time. In continuous execution the
    duration of the motion alone gives it.
    """
    result = step.result
    if result is not None and step.answer is not None:
        result = replace(result, duration_s=math.nan, waiting_s=None)
    return replace(
        step,
        raw_action=step.action.value,
        recorded_at=None,
        stamp_s=None,
        timings=StepTimings(),
        answer=None,
        result=result,
        probabilities={},
        details={},
    )


def hide_steps(steps: Iterable[StepRecord]) -> tuple[StepRecord, ...]:
    """Return the hidden steps of an episode, each with the sum of the motions before it as its stamp, in seconds.

    In continuous execution each of these motions counts as one second.
    """
    hidden, clock_s = [], 0.0
    for step in steps:
        hidden.append(replace(hide_step(step), stamp_s=clock_s))
        lasted_s = 1.0 if step.answer is not None else step.result.duration_s if step.result else 0.0
        clock_s += lasted_s if math.isfinite(lasted_s) else 0.0
    return tuple(hidden)


def hide_record(episode: EpisodeRecord) -> EpisodeRecord:
    """Return an episode without identifying data."""
    return replace(
        episode,
        verdicts=tuple(
            replace(verdict, reason=verdict.end_reason) if verdict.end_reason in TELLING else verdict
            for verdict in episode.verdicts
        ),
        events=tuple(replace(event, text=HIDDEN) if event.kind in TELLING else event for event in episode.events),
        provenance=_hide_provenance(episode.provenance),
    )


def _hide_provenance(recorded: EpisodeProvenance) -> EpisodeProvenance:
    platform = {name: value for name, value in recorded.platform.items() if not name.startswith("model_")}
    return replace(without_hidden(recorded), platform=platform)
