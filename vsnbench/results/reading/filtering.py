"""Restricts a query to the episodes of a filter."""

from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, or_, select

from vsnbench.protocol.disturbances import text_of_conditions
from vsnbench.results.annotations import has_note, has_tag
from vsnbench.results.reading.blinding import CAMPAIGN_KEY, CAMPAIGN_NAME, MODEL_NAME
from vsnbench.results.reading.read_model import END_REASON, SUCCESS
from vsnbench.results.reading.rows import EpisodeFilter
from vsnbench.results.schema.tables import Campaign, Episode, Trial
from vsnbench.results.writing.lifecycle import ACTIVE, EpisodeState

_SHORTEST_KEY = 8
"""Minimum number of a key's digits; shorter numbers are campaign numbers."""
_SUCCESS = {"success": True, "failure": False}
_STATES = {"running": ACTIVE, "unjudged": (EpisodeState.AWAITING,), "void": (EpisodeState.VOID,)}


def restricted(
    connection: Connection, query: Select[*tuple[Any, ...]], which: EpisodeFilter
) -> Select[*tuple[Any, ...]]:
    """Return a query of `episodes_of_campaigns` with the conditions of a filter."""
    if which.models:
        query = query.where(MODEL_NAME.in_(list(which.models)))
    if which.goals:
        query = query.where(Trial.goal.in_(which.goals))
    if which.campaign.isdecimal() and len(which.campaign) < _SHORTEST_KEY:
        query = query.where(or_(Campaign.id == int(which.campaign), CAMPAIGN_NAME.in_([which.campaign])))
    elif which.campaign:
        same: list[ColumnElement[bool]] = [CAMPAIGN_NAME.in_([which.campaign])]
        if len(which.campaign) >= _SHORTEST_KEY:
            same.append(CAMPAIGN_KEY.startswith(which.campaign, autoescape=True))
        query = query.where(or_(*same))
    if which.disturbances is not None:
        campaigns = connection.execute(select(Campaign.id, Campaign.conditions))
        wanted = which.disturbances.text
        like = [row.id for row in campaigns if text_of_conditions(row.conditions) == wanted]
        query = query.where(Campaign.id.in_(like))
    query = query.where(*map(has_tag, which.tags))
    if which.note:
        query = query.where(has_note(which.note))
    if which.outcome in _SUCCESS:
        query = query.where(SUCCESS.is_(_SUCCESS[which.outcome]))
    elif which.outcome in _STATES:
        query = query.where(Episode.state.in_([state.value for state in _STATES[which.outcome]]))
    elif which.outcome:
        query = query.where(END_REASON.in_([which.outcome]))
    return query
