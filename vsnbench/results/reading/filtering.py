"""Filters of episodes: a selection by a user, and the conditions that it adds to a query."""

from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, or_, select

from vsnbench.protocol.disturbances import Disturbances, text_of_conditions
from vsnbench.protocol.judge import EndReason
from vsnbench.results.annotations import has_note, has_tag
from vsnbench.results.reading.read_model import CAMPAIGN_KEY, CAMPAIGN_NAME, END_REASON, MODEL_NAME, OUTCOME
from vsnbench.results.schema.tables import CampaignRow, EpisodeRow, TrialRow

_SHORTEST_KEY = 8
"""Minimum number of a key's digits; shorter numbers are campaign numbers."""
OUTCOMES = ("success", "failure", "void", "running", "unjudged", *(reason.value for reason in EndReason))
"""Outcomes that `EpisodeFilter.outcome` accepts."""


@dataclass(frozen=True, slots=True)
class EpisodeFilter:
    """Selection of episodes; empty fields select all."""

    models: tuple[str, ...] = ()
    goals: tuple[str, ...] = ()
    campaign: str = ""
    """Number or name of the campaign, or at least eight leading digits of its key."""
    outcome: str = ""
    """`success`, `failure`, `void`, `running`, `unjudged` or an end reason."""
    tags: tuple[str, ...] = ()
    """Episodes with all of these tags."""
    disturbances: Disturbances | None = None
    """Episodes with exactly these disturbances; None for all episodes."""
    note: str = ""
    """Episodes with these words in a note, or in the note of a verdict."""
    numbers: tuple[int, ...] = ()
    """Episodes with these numbers."""
    has_ended: bool = False
    """Only episodes that have ended."""


def restricted(
    connection: Connection, query: Select[*tuple[Any, ...]], which: EpisodeFilter
) -> Select[*tuple[Any, ...]]:
    """Return a query of `episodes_of_campaigns` with the conditions of a filter."""
    if which.models:
        query = query.where(MODEL_NAME.in_(list(which.models)))
    if which.goals:
        query = query.where(TrialRow.goal.in_(which.goals))
    if which.campaign.isdecimal() and len(which.campaign) < _SHORTEST_KEY:
        query = query.where(or_(CampaignRow.id == int(which.campaign), CAMPAIGN_NAME.in_([which.campaign])))
    elif which.campaign:
        same: list[ColumnElement[bool]] = [CAMPAIGN_NAME.in_([which.campaign])]
        if len(which.campaign) >= _SHORTEST_KEY:
            same.append(CAMPAIGN_KEY.startswith(which.campaign, autoescape=True))
        query = query.where(or_(*same))
    if which.disturbances is not None:
        campaigns = connection.execute(select(CampaignRow.id, CampaignRow.conditions))
        wanted = which.disturbances.text
        like = [row.id for row in campaigns if text_of_conditions(row.conditions) == wanted]
        query = query.where(CampaignRow.id.in_(like))
    query = query.where(*map(has_tag, which.tags))
    if which.note:
        query = query.where(has_note(which.note))
    if which.numbers:
        query = query.where(EpisodeRow.id.in_(which.numbers))
    if which.has_ended:
        query = query.where(EpisodeRow.end_reason.is_not(None))
    if which.outcome:
        is_reason = which.outcome in set(EndReason)
        query = query.where((END_REASON if is_reason else OUTCOME).in_([which.outcome]))
    return query
