"""Interventions: how they are written and what counts as one, in the one place that knows both.

A person intervenes who acts on a real robot outside the protocol's placing: stops it with the emergency key or
Ctrl-C, calls a collision that it did not feel, takes it by hand out of where a failed motion or a lost sensor left it.
Each is one event. The robot of a simulation needs nobody: whoever ends one only ends a process.
"""

from sqlalchemy import ColumnElement, and_, exists
from sqlalchemy.orm import aliased

from vsnbench.database.tables import Episode, Event
from vsnbench.protocol.judge import EndReason

INTERVENTION = "intervention"
"""Kind of the events that say that a person intervened."""


def intervention_words(what: str, who: str) -> str:
    """Return the event's text: what was done, and by whom where that is known."""
    return f"{what}, by {who}" if who else what


def aborted_unwritten(episode: type[Episode], end_reason: ColumnElement[str]) -> ColumnElement[bool]:
    """Return the condition for an aborted episode without an event of its own, which counts as one intervention.

    Such are the episodes that a person made void afterwards, and those of records older than the events. An episode
    with an event is counted by that alone, so that an abort never counts twice.

    Args:
        episode: the table or an alias of it.
        end_reason: of the standing verdict, or as the episode ended.
    """
    event = aliased(Event)
    written = exists().where(event.episode_id == episode.id, event.kind == INTERVENTION).correlate(episode)
    return and_(end_reason == EndReason.ABORTED.value, ~written)
