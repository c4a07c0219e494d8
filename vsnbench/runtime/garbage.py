"""Sets how often Python collects garbage: rarely while modules load, as usual while trials run.

At Python's default, collections while modules load take 0.3 s of a run. Later, a model's cycles of references would
keep images in memory.
"""

import gc

_ALLOCATIONS = 10_000
"""Allocations between two collections while modules load."""
_before: list[tuple[int, int, int]] = []
"""The thresholds to restore, if any."""


def collect_rarely() -> None:
    """Collect garbage a tenth as often, until `collect_as_usual`; a caller that collects more rarely goes on so."""
    if not _before and gc.get_threshold()[0] < _ALLOCATIONS:
        _before.append(gc.get_threshold())
        gc.set_threshold(_ALLOCATIONS, *_before[0][1:])


def collect_as_usual() -> None:
    """Collect garbage as often as before `collect_rarely`, if that was called."""
    if _before:
        gc.set_threshold(*_before.pop())
