"""The result of one check of a check-up."""

from dataclasses import dataclass
from enum import StrEnum


class Health(StrEnum):
    """Health of a part."""

    OK = "ok"
    WARNING = "warning"
    """A session is possible, but its results may suffer."""
    ABSENT = "absent"
    """An optional part is not installed; a session without it is possible."""
    FAILED = "failed"
    """No session is possible."""


@dataclass(frozen=True, slots=True)
class CheckResult:
    """Result of one check."""

    what: str
    health: Health
    seen: str
    advice: str = ""
    """The fix; empty if there is nothing to fix."""
