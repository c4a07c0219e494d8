"""The table of faults that tests over ROS fill: what the base did, how an episode ends, and what `doctor` finds."""

import json
import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tests.processes import Process
from tests.robots.client import Client, ClientError

WITH_DOCTOR = bool(os.environ.get("FAULT_TABLE"))
"""Whether `doctor` examines each fault. It takes 6 s per fault, so only when the table is measured."""
STARTED_M, STARTED_DEG = 0.002, 0.2
"""A base that has moved by more has started a movement."""
_WATCHED_S = 0.5
Truth = Callable[[], tuple[float, float, float]]
"""Returns where a base truly is: metres and degrees."""


@dataclass(frozen=True)
class Attempt:
    """A movement that was requested during a fault."""

    why: str
    """Why it did not start, or an empty string."""
    end_reason: str
    moved_m: float
    turned_deg: float

    @property
    def started(self) -> bool:
        """Whether the base has truly moved."""
        return self.moved_m > STARTED_M or abs(self.turned_deg) > STARTED_DEG

    def __str__(self) -> str:
        if self.started:
            return f"moved {self.moved_m * 100:.1f} cm, {self.turned_deg:.1f}°"
        return f"none: {self.why}"


def attempt(client: Client, truth: Truth, name: str, *arguments: Any) -> Attempt:
    """Request a movement as a run does, and compare the base's true pose before and after."""
    before = truth()
    try:
        result = client(name, *arguments)
        why, reason = result["failure"] or result["blocked"], result["end_reason"]
    except ClientError as error:
        why, reason = str(error).partition(": ")[2], error.end_reason
    until_s = time.monotonic() + _WATCHED_S
    while time.monotonic() < until_s:
        time.sleep(0.05)
    after = truth()
    return Attempt(why, reason, math.dist(before[:2], after[:2]), math.remainder(after[2] - before[2], 360))


def held(second: Attempt) -> str:
    """Return the column of a base that another publisher drives."""
    return f"none: {second.why}; the other publisher moved the base {second.moved_m * 100:.1f} cm"


def checks_of(doctor: Process) -> dict[str, tuple[str, str]]:
    """Wait for `doctor --json`; return health and finding of each check."""
    doctor.wait(120)
    start = doctor.output.index("{\n")
    checks = json.JSONDecoder().raw_decode(doctor.output[start:])[0]["checks"]
    return {check["what"]: (check["health"], check["seen"]) for check in checks}


def complaints(doctor: Process, healthy: frozenset[str] = frozenset()) -> dict[str, str]:
    """Wait for `doctor --json`; return the failed checks, without those of the healthy robot."""
    found = checks_of(doctor)
    return {what: seen for what, (health, seen) in found.items() if health != "ok" and what not in healthy}


def doctor_text(found: dict[str, str]) -> str:
    """Return the table's column."""
    return "; ".join(f"{what}: {seen}" for what, seen in found.items()) or "no fault"


@dataclass(frozen=True)
class FaultRow:
    """A fault with the base's motion and vsnbench's reports."""

    cause: str
    zero_s: float | None
    """Time from the fault to the first of the zero velocities that the base received for good."""
    rest_s: float | None
    end_reason: str
    why: str
    doctor: str = "–"
    second: str = "–"

    @property
    def cells(self) -> list[str]:
        """The columns as text."""
        return [
            self.cause,
            *("–" if value is None else f"{max(value, 0.0):.2f} s" for value in (self.zero_s, self.rest_s)),
            self.end_reason,
            self.why,
            self.doctor,
            self.second,
        ]


@dataclass
class FaultTable:
    """Rows of one rig, printed as Markdown at its end."""

    title: str
    rows: list[FaultRow] = field(default_factory=list)

    def write(self) -> None:
        """Print the table."""
        columns = ["cause", "zero commanded", "at rest", "end reason", "words", "`doctor`", "a second movement"]
        lines = [columns, ["---"] * len(columns), *(row.cells for row in self.rows)]
        text = "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines)
        sys.stdout.write(f"\n### {self.title}\n{text}\n")
