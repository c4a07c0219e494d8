"""Interventions: how they are written and what counts as one, in the one place that knows both.

A person intervenes who acts on a real robot outside the protocol's placing: stops it with the emergency key or
Ctrl-C, calls a collision that it did not feel, takes it by hand out of where a failed motion or a lost sensor left it.
Each is one event. The robot of a simulation needs nobody: whoever ends one only ends a process.
"""

from collections.abc import Iterable, Mapping

INTERVENTION = "intervention"
"""Kind of the events that say that a person intervened."""


def intervention_words(what: str, who: str) -> str:
    """Return the event's text: what was done, and by whom where that is known."""
    return f"{what}, by {who}" if who else what


def interventions(written: Mapping[int, int], aborted: Iterable[int]) -> dict[int, int]:
    """Return how often a person intervened, by the number of the episode.

    An aborted episode without an event counts as one: a person made it void afterwards, or the record is older than
    the events. With one it is counted by its events alone, so that an abort never counts twice.

    Args:
        written: events of kind `INTERVENTION` by episode.
        aborted: episodes of real robots whose standing end reason is `aborted`.
    """
    return dict.fromkeys(aborted, 1) | dict(written)
