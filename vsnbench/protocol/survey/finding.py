"""One thing that is wrong, or odd, with a surveyed site: what, where, by how much, and what to do."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from vsnbench.errors import VsnbenchError
from vsnbench.protocol.site import Point

TOUCHING_M2 = 5e-4
"""Overlaps smaller than this are a survey's rounding."""


class Severity(StrEnum):
    """How bad a finding is: trials on a site with errors are not worth running."""

    ERROR = "error"
    WARNING = "warning"


class PlaceKind(StrEnum):
    """How the points of a place hang together; the words are GeoJSON's."""

    POINTS = "MultiPoint"
    STRETCH = "LineString"
    AREA = "Polygon"


@dataclass(frozen=True, slots=True)
class Place:
    """Where a finding is on the floor plan, metres in the site's frame; nowhere when it has no points."""

    kind: PlaceKind = PlaceKind.POINTS
    points: tuple[Point, ...] = ()

    def geometry(self) -> dict[str, Any] | None:
        """Return the place as a GeoJSON geometry, or None for nowhere."""
        if not self.points:
            return None
        points = [[round(x_m, 4), round(y_m, 4)] for x_m, y_m in self.points]
        if self.kind is PlaceKind.AREA:
            return {"type": self.kind.value, "coordinates": [[*points, points[0]]]}
        return {"type": self.kind.value, "coordinates": points}


def points(*where: Point) -> Place:
    """Return single points."""
    return Place(PlaceKind.POINTS, where)


def stretch(start: Point, end: Point) -> Place:
    """Return what lies between two points."""
    return Place(PlaceKind.STRETCH, (start, end))


def area(*corners: Point) -> Place:
    """Return what an outline encloses."""
    return Place(PlaceKind.AREA, corners)


@dataclass(frozen=True, slots=True)
class Amount:
    """By how much something is wrong."""

    value: float
    unit: str = "m"


Entry = tuple[str, int]
"""An entry of the site file by its list and its place in it, from 0: ("walls", 2) is wall 3."""


@dataclass(frozen=True, slots=True)
class SiteFinding:
    """A fault of a site as data: for a person to read, a drawing to light up, a script to sort."""

    severity: Severity
    code: str
    """Which kind of mistake it is; stays the same whatever the words."""
    subject: str
    """What it is about, as the file names it: "the kitchen's edge from (0, 0) to (3, 0)", "wall 3", "bed-1"."""
    problem: str
    """What is wrong, where and by how much; together with the subject it is a sentence."""
    mend: str = ""
    """What to do about it."""
    place: Place = Place()
    amount: Amount | None = None
    entries: tuple[Entry, ...] = ()
    """The entries of the file that have a part in it."""
    line: int | None = None
    """Where in the file, from 1, when it breaks the format."""

    @property
    def statement(self) -> str:
        """What is wrong, in a sentence."""
        return f"{self.subject} {self.problem}"

    @property
    def message(self) -> str:
        """The whole in a line."""
        if self.subject.endswith(":"):
            return self.statement + (f": {self.mend}" if self.mend else "")
        return str(VsnbenchError(self.statement, advice=self.mend))

    def content(self) -> dict[str, Any]:
        """Return the finding as plain JSON values."""
        return {
            "severity": self.severity.value,
            "code": self.code,
            "subject": self.subject,
            "problem": self.problem,
            "mend": self.mend,
            "message": self.message,
            "place": self.place.geometry(),
            "amount": None if self.amount is None else {"value": round(self.amount.value, 4), "unit": self.amount.unit},
            "entries": [list(entry) for entry in self.entries],
            "line": self.line,
        }


def shown(point: Point) -> str:
    """Return a point as the site file has it, to the centimetre."""
    x_m, y_m = (round(value, 2) + 0.0 for value in point)
    return f"({x_m:g}, {y_m:g})"


def between(start: Point, end: Point) -> str:
    """Return a stretch by its ends."""
    return f"from {shown(start)} to {shown(end)}"


def listed(names: list[str], last: str = "and") -> str:
    """Return names as one says them: a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def numbered(kind: str, numbers: list[int]) -> str:
    """Return numbered things as one says them, runs of three or more by their ends: starts 1 to 5 and 12."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    words = [
        part
        for run in runs
        for part in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(number) for number in run])
    ]
    return f"{kind}{'' if len(numbers) == 1 else 's'} {listed(words)}"
