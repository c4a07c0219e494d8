"""Results of a verification: what was checked, what failed, and what could not be checked."""

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from vsnbench.errors import VsnbenchError
from vsnbench.text.sanitize import error_line, sanitize

Progress = Callable[[str, int, int], None]
"""Called with the name of a check, the amount done and the total."""
_LONGEST = 300
logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that does not hold."""

    where: str
    """A file, or a table with the row and the column, such as `step 3/17: rgb_digest`."""
    text: str

    def __str__(self) -> str:
        return f"{self.where}: {self.text}" if self.where else self.text


@dataclass(slots=True)
class Check:
    """One kind of check with its counts."""

    name: str
    unit: str
    """What is counted, plural."""
    checked: int = 0
    """Number of items that were checked, with those that failed."""
    failed: int = 0
    findings: list[Finding] = field(default_factory=list)
    not_checked: Counter[str] = field(default_factory=Counter)
    """Reason -> number of items that could not be checked."""
    notes: list[str] = field(default_factory=list)
    """Results to state although nothing failed, such as who signed."""

    def add(self, findings: list[Finding]) -> None:
        """Count a checked item with its findings; it failed if it has any."""
        self.checked += 1
        self.failed += bool(findings)
        self.findings += findings

    def fail(self, where: str, text: str) -> None:
        """Count an item that failed."""
        self.add([finding(where, text)])

    def skip(self, reason: str, count: int = 1) -> None:
        """Count items that cannot be checked."""
        self.not_checked[reason] += count

    @contextmanager
    def failing(self, where: str) -> Iterator[None]:
        """Count an item as failed if content of the record ends its check with an error.

        The record is not trusted: no value of it may end the other checks, whatever the error is.
        """
        try:
            yield
        except Exception as error:
            logger.debug("%s of %s", self.name, where, exc_info=True)
            self.fail(where, f"cannot be checked: {error_line(error, named=not isinstance(error, VsnbenchError))}")


def finding(where: str, text: str) -> Finding:
    """Return a finding with printable texts of limited length."""
    return Finding(sanitize(where)[:_LONGEST], sanitize(text)[:_LONGEST])


def cell(table: str, row: object, column: str, text: str) -> Finding:
    """Return a finding about a cell of the database."""
    return finding(f"{table} {row}: {column}", text)


@dataclass(frozen=True, slots=True)
class Verification:
    """What a verification checked and found."""

    subject: str
    """The file or directory as the user named it."""
    version: str
    """Version of vsnbench that verified it."""
    written_by: tuple[str, ...]
    """Versions of vsnbench that wrote the record."""
    checks: tuple[Check, ...]
    people: dict[str, int]
    """Author -> number of verdicts of this person."""

    @property
    def holds(self) -> bool:
        """Whether every check that could be made holds."""
        return not any(check.failed or check.findings for check in self.checks)
