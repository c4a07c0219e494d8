"""What of a locked study may still be changed: nothing that its schedule was drawn from."""

from vsnbench.errors import StudyError
from vsnbench.study.file import StudyFile

FROZEN = (
    *("arms", "goals", "site", "robot", "noise", "pretend_real"),
    *("starting_positions", "repetitions", "protocol", "order", "seed", "blind"),
)
"""Fields that stay as they were locked: with others it is another experiment."""
JUDGING = ("primary", "stopping", "about", "alpha", "margin")
"""Fields that say how the answer is found: changed after the first result, the conclusion says so."""


def check_amendment(before: StudyFile, after: StudyFile) -> None:
    """Refuse a change of what was drawn.

    Raises:
        StudyError: a frozen field was changed.
    """
    changed = changed_fields(before, after, FROZEN)
    if changed:
        names = ", ".join(changed)
        raise StudyError(
            f"{names}: no amendment can change what the schedule was drawn from; restore it, and lock a new study for "
            "another one"
        )


def changed_fields(before: StudyFile, after: StudyFile, among: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the fields, of these, that differ."""
    return tuple(name for name in among if getattr(before, name) != getattr(after, name))
