"""Findings of a site check: what is wrong, where, by how much, and the fix."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.errors import VsnbenchError
from vsnbench.sites.fields import Point
from vsnbench.sites.site import Site

TOUCHING_M2 = 5e-4
"""Smaller overlaps are rounding of the survey."""


class Severity(StrEnum):
    """Severity of a finding; trials on a site with errors are not valid."""

    ERROR = "error"
    WARNING = "warning"


class PlaceKind(StrEnum):
    """Geometry type of a place, with GeoJSON's names."""

    POINTS = "MultiPoint"
    STRETCH = "LineString"
    AREA = "Polygon"


@dataclass(frozen=True, slots=True)
class MarkedPlace:
    """Location of a finding on the floor plan, metres in the site's frame; without points it has none."""

    kind: PlaceKind = PlaceKind.POINTS
    points: tuple[Point, ...] = ()

    def geometry(self) -> dict[str, Any] | None:
        """Return the place as a GeoJSON geometry, or None without points."""
        if not self.points:
            return None
        points = [[round(x_m, 4), round(y_m, 4)] for x_m, y_m in self.points]
        if self.kind is PlaceKind.AREA:
            return {"type": self.kind.value, "coordinates": [[*points, points[0]]]}
        return {"type": self.kind.value, "coordinates": points}


def points(*where: Point) -> MarkedPlace:
    """Return a place of single points."""
    return MarkedPlace(PlaceKind.POINTS, where)


def stretch(start: Point, end: Point) -> MarkedPlace:
    """Return the line between two points as a place."""
    return MarkedPlace(PlaceKind.STRETCH, (start, end))


def area(*corners: Point) -> MarkedPlace:
    """Return the area inside an outline as a place."""
    return MarkedPlace(PlaceKind.AREA, corners)


def outline(polygon: BaseGeometry) -> MarkedPlace:
    """Return the exterior of a polygon as a place."""
    return area(*((x, y) for x, y in shapely.get_coordinates(shapely.get_exterior_ring(polygon))[:-1].tolist()))


Entry = tuple[str, int]
"""An entry of the site file: list and index from 0; ("walls", 2) is wall 3."""


@dataclass(frozen=True, slots=True)
class SiteFinding:
    """One finding about a site."""

    severity: Severity
    code: str
    """Stable name of the kind of error."""
    subject: str
    """The entry as the file names it: "the kitchen's edge from (0, 0) to (3, 0)", "wall 3", "bed-1"."""
    problem: str
    """The rest of the sentence that begins with the subject: what is wrong, where and by how much."""
    advice: str = ""
    """The fix."""
    place: MarkedPlace = MarkedPlace()
    amount: float | None = None
    """Size of the error, in `unit`."""
    entries: tuple[Entry, ...] = ()
    """Entries of the file that cause it."""
    unit: str = "m"
    line: int | None = None
    """Line of the file, from 1, for an error of the format."""

    @property
    def statement(self) -> str:
        """The subject and the problem as one sentence."""
        return f"{self.subject} {self.problem}"

    @property
    def message(self) -> str:
        """The statement and the advice in one line."""
        if self.subject.endswith(":"):
            return self.statement + (f": {self.advice}" if self.advice else "")
        return str(VsnbenchError(self.statement, advice=self.advice))

    def content(self) -> dict[str, Any]:
        """Return the finding as plain JSON values."""
        return {
            "severity": self.severity.value,
            "code": self.code,
            "subject": self.subject,
            "problem": self.problem,
            "advice": self.advice,
            "message": self.message,
            "place": self.place.geometry(),
            "amount": None if self.amount is None else {"value": round(self.amount, 4), "unit": self.unit},
            "entries": [list(entry) for entry in self.entries],
            "line": self.line,
        }


def goal_entries(site: Site, names: Iterable[str]) -> tuple[Entry, ...]:
    """Return the entries of goals in the site file; a category has none."""
    index_of = {goal.id: index for index, goal in enumerate(site.goals)}
    return tuple(("goals", index_of[name]) for name in names if name in index_of)


def point_text(point: Point) -> str:
    """Return a point as text, to the centimetre: (1.25, 3)."""
    x_m, y_m = (round(value, 2) + 0.0 for value in point)
    return f"({x_m:g}, {y_m:g})"


def range_text(start: Point, end: Point) -> str:
    """Return two points as text: from (0, 0) to (3, 0)."""
    return f"from {point_text(start)} to {point_text(end)}"


def join_names(names: list[str], last: str = "and") -> str:
    """Return names as text: a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def number_ranges(kind: str, numbers: list[int]) -> str:
    """Return numbers as text, with ranges of three or more: starts 1 to 5 and 12."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    parts = [
        part
        for run in runs
        for part in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(number) for number in run])
    ]
    return f"{kind}{'' if len(numbers) == 1 else 's'} {join_names(parts)}"
