"""One line of a check-up: what was looked at, how it stands, and what to do about it."""

from dataclasses import dataclass
from enum import StrEnum


class Health(StrEnum):
    """How something stands."""

    OK = "ok"
    WARNING = "warning"
    """A session is possible; its results may suffer."""
    FAILED = "failed"
    """No session is possible."""


@dataclass(frozen=True, slots=True)
class CheckResult:
    """One line of a check-up."""

    what: str
    health: Health
    seen: str
    advice: str = ""
    """What to do about it; empty when all is well."""
