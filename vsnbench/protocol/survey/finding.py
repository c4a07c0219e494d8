"""One thing that is wrong, or odd, with a surveyed site: what, where, by how much, and what to do."""

from dataclasses import dataclass
from enum import StrEnum

from vsnbench.protocol.site import Point

TOUCHING_M2 = 5e-4
"""Overlaps smaller than this are a survey's rounding."""


class Severity(StrEnum):
    """How bad a finding is: trials on a site with errors are not worth running."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class SiteFinding:
    """A fault of a site, in words for a person and with its place for a drawing."""

    severity: Severity
    subject: str
    """What it is about, as the file names it: `room bedroom`, `wall 3`, `bed-1`, `starting position 4`."""
    problem: str
    """What is wrong, where and by how much; together with the subject it is a sentence."""
    mend: str = ""
    """What to do about it."""
    at: tuple[Point, ...] = ()
    """Where: one point, or the ends of a stretch; metres in the site's frame."""

    @property
    def message(self) -> str:
        """The whole in a line."""
        return f"{self.subject} {self.problem}" + (f": {self.mend}" if self.mend else "")


def error(subject: str, problem: str, mend: str = "", *at: Point) -> SiteFinding:
    """Return a finding that makes trials on the site worth nothing."""
    return SiteFinding(Severity.ERROR, subject, problem, mend, at)


def warning(subject: str, problem: str, mend: str = "", *at: Point) -> SiteFinding:
    """Return a finding that a person should know of."""
    return SiteFinding(Severity.WARNING, subject, problem, mend, at)


def shown(point: Point) -> str:
    """Return a point as the site file has it, to the centimetre."""
    x_m, y_m = (round(value, 2) + 0.0 for value in point)
    return f"({x_m:g}, {y_m:g})"


def between(start: Point, end: Point) -> str:
    """Return a stretch by its ends."""
    return f"{shown(start)} to {shown(end)}"
