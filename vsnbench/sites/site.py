"""Surveyed site: rooms, walls, doors, objects and numbered starting positions, read from one YAML file.

World frame of a site: metres, x to the right and y up on the floor plan, headings in degrees counter-clockwise
from x. The judge measures distances in this description, and the simulator builds its world from it.
"""

import hashlib
import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)
from shapely import affinity
from shapely.geometry import LineString, Polygon, box

from vsnbench.errors import SiteFileError, UsageError
from vsnbench.files.package_data import resource_directory
from vsnbench.settings.field_errors import FieldsError
from vsnbench.settings.validation import SettingsFault
from vsnbench.settings.yaml_file import CHECKING, DIRECTORY, parse_settings, read_settings, settings_faults
from vsnbench.sites.categories import ALIASES, CATEGORIES, CATEGORY_WORD, GOAL_CATEGORIES, suggest_category
from vsnbench.sites.fields import Color, Heading, Point, Slug, StrictModel, check_outline
from vsnbench.sites.goals import SiteGoal, check_references
from vsnbench.sites.length_unit import check_rooms
from vsnbench.sites.scan import SiteScan, content_sha256
from vsnbench.text.suggestions import closest
from vsnbench.values.pose import Pose


class _Segment(StrictModel):
    """Line between two different points on the floor plan."""

    start: Point
    end: Point

    @model_validator(mode="after")
    def _has_a_length(self) -> Self:
        if self.length_m < _SHORTEST_M:
            raise ValueError(f"start and end are the same point, {list(self.start)}")
        return self

    @property
    def length_m(self) -> float:
        """Distance between the two points, metres."""
        return math.dist(self.start, self.end)

    @property
    def centre_line(self) -> LineString:
        """The line between the two points."""
        return LineString([self.start, self.end])

    @cached_property
    def opening(self) -> Polygon:
        """The opening that a door or window cuts: a strip wider than any wall."""
        return self.centre_line.buffer(0.3, cap_style="flat")


_SHORTEST_M = 0.02


class Room(StrictModel):
    """A room: its outline on the floor plan and its floor."""

    name: str
    polygon: list[Point] = Field(min_length=3)
    floor: Literal["wood", "tiles", "carpet", "concrete"] = "wood"
    floor_color: Color | None = None

    _polygon_encloses = field_validator("polygon")(check_outline)

    @cached_property
    def shape(self) -> Polygon:
        """The outline as a polygon, metres."""
        return Polygon(self.polygon)


class Wall(_Segment):
    """A straight wall between two points on its centre line; its doors and windows are cut out."""

    thickness_m: float = Field(default=0.10, gt=0.01, lt=1)
    height_m: float | None = Field(default=None, gt=0.1, description="default: the site's ceiling height")
    color: Color | None = None

    @cached_property
    def shape(self) -> Polygon:
        """Footprint of the wall without openings; square ends reach half a thickness past both points."""
        return self.centre_line.buffer(self.thickness_m / 2, cap_style="square")


class Door(_Segment):
    """A doorway: the clear opening between two points on a wall's centre line.

    The leaf is hinged at `start`, swings to the left of start -> end, and is open during trials unless `closed`.
    """

    name: str
    height_m: float = Field(default=2.0, gt=1.0, lt=4)
    closed: bool = False


class Window(_Segment):
    """A window between two points on a wall's centre line; robots cannot pass it."""

    sill_m: float = Field(default=0.9, ge=0, lt=3)
    head_m: float = Field(default=2.1, gt=0, lt=4)

    @model_validator(mode="after")
    def _has_a_height(self) -> Self:
        if self.head_m <= self.sill_m:
            raise ValueError(f"head_m of {self.head_m:g} m is not above sill_m of {self.sill_m:g} m")
        return self


class SiteObject(StrictModel):
    """An object of the site: a goal instance or furniture.

    Its local frame is centred on its footprint; x (heading) points out of its front: the seat of a chair, the screen
    of a monitor, the doors of a cabinet.
    """

    id: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    category: str
    position: Point
    heading_deg: Heading = 0.0
    size_m: tuple[
        Annotated[float, Field(ge=0.001, lt=20)],
        Annotated[float, Field(ge=0.001, lt=20)],
        Annotated[float, Field(ge=0.001, lt=5)],
    ] = Field(description="depth along its heading, width across it, height; metres")
    elevation_m: float = Field(default=0.0, ge=0, lt=4, description="underside above the floor, metres")
    footprint: list[Point] | None = Field(default=None, min_length=3, description="surveyed outline, world frame")
    model: str | None = Field(default=None, description="appearance in the simulator; default: by category")
    color: Color | None = None
    solid: bool = Field(default=True, description="whether a robot can collide with it (a rug is not)")

    _footprint_encloses = field_validator("footprint")(check_outline)

    @field_validator("category")
    @classmethod
    def _category_is_a_word(cls, name: str, info: ValidationInfo) -> str:
        """Reject in a check what is not a word of lower case, or another name of a category."""
        if not info.context or not info.context.get(CHECKING) or name in CATEGORIES:
            return name
        if name in ALIASES or not CATEGORY_WORD.fullmatch(name):
            raise ValueError(f"unknown category {name!r}: {suggest_category(name)}")
        return name

    @property
    def pose(self) -> Pose:
        """Centre and heading in the site's frame."""
        return Pose.from_degrees(*self.position, self.heading_deg)

    @cached_property
    def shape(self) -> Polygon:
        """Footprint on the floor plan: the surveyed outline, else the rectangle of `size_m`."""
        if self.footprint is not None:
            return Polygon(self.footprint)
        depth, width, _ = self.size_m
        upright = box(-depth / 2, -width / 2, depth / 2, width / 2)
        turned = affinity.rotate(upright, self.heading_deg, origin=(0, 0))
        return affinity.translate(turned, *self.position)


class StartingPosition(StrictModel):
    """A numbered pose from which episodes start (paper, Figure 3: the floor plan)."""

    number: int = Field(ge=1, le=9999)
    position: Point
    heading_deg: Heading
    note: str = ""
    not_for: list[Slug] = Field(default=[], description="goals without trials from this start")

    @model_serializer(mode="wrap")
    def _omit_empty_not_for(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit an empty `not_for`, so that hashes of sites do not change."""
        content: dict[str, Any] = serialize(self)
        return content if self.not_for else {name: value for name, value in content.items() if name != "not_for"}

    @property
    def pose(self) -> Pose:
        """Place and heading in the site's frame."""
        return Pose.from_degrees(*self.position, self.heading_deg)


class Site(StrictModel):
    """A surveyed site."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    title: str = ""
    ceiling_height_m: float = Field(default=2.5, gt=1.5, lt=10)
    survey_error_m: float = Field(default=0.01, gt=0, le=0.2, description="standard deviation of walls; objects twice")
    rooms: list[Room] = Field(min_length=1)
    walls: list[Wall] = Field(min_length=1)
    doors: list[Door] = Field(default=[])
    windows: list[Window] = Field(default=[])
    objects: list[SiteObject] = Field(default=[])
    starts: list[StartingPosition] = Field(min_length=1)
    goals: list[SiteGoal] = Field(default=[], max_length=1000, description="goals beyond the categories of objects")
    scan: SiteScan | None = Field(default=None, description="scan that the simulator draws instead of the survey")

    _is_in_metres = model_validator(mode="before")(check_rooms)

    @field_validator("rooms", "doors", "objects", "starts", "goals")
    @classmethod
    def _names_are_unique(cls, things: list[Any], info: ValidationInfo) -> list[Any]:
        key = {"objects": "id", "goals": "id", "starts": "number"}.get(info.field_name or "", "name")
        names = [str(getattr(thing, key)) for thing in things]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)} is repeated")
        return things

    @field_validator("goals")
    @classmethod
    def _sequences_have_their_goals(cls, goals: list[SiteGoal]) -> list[SiteGoal]:
        return [goal.with_parts({other.id: other for other in goals}) if goal.goals else goal for goal in goals]

    @model_validator(mode="after")
    def _goals_are_surveyed(self, info: ValidationInfo) -> Self:
        check_references(self.goals, self)
        context = info.context or {}
        known = {*GOAL_CATEGORIES, *CATEGORIES, *self.categories, *(goal.id for goal in self.goals)}
        if CHECKING not in context and DIRECTORY not in context:  # a record has no goals
            return self
        if unknown := [
            (("starts", index, "not_for", place), f"{name!r} is not a goal of the site")
            for index, start in enumerate(self.starts)
            for place, name in enumerate(start.not_for)
            if name not in known
        ]:
            raise FieldsError(unknown)
        return self

    @model_serializer(mode="wrap")
    def _omit_default_survey_error(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit the default `survey_error_m` and no scan, which keeps hashes, and the goals, which have their own."""
        content: dict[str, Any] = serialize(self)
        content.pop("goals", None)
        if self.survey_error_m == type(self).model_fields["survey_error_m"].default:
            content.pop("survey_error_m", None)
        if self.scan is None:
            content.pop("scan", None)
        return content

    @property
    def area_m2(self) -> float:
        """Floor area of all rooms, square metres."""
        return float(sum(room.shape.area for room in self.rooms))

    @property
    def categories(self) -> frozenset[str]:
        """Categories of the site's objects."""
        return frozenset(thing.category for thing in self.objects)

    def instances(self, category: str) -> list[SiteObject]:
        """Return the objects of a category."""
        return [thing for thing in self.objects if thing.category == category]

    @property
    def excluded(self) -> frozenset[tuple[str, int]]:
        """Pairs of goal and number of starting position that have no trials."""
        pairs = {(goal, start.number) for start in self.starts for goal in start.not_for}
        limited = ((goal, start.number) for goal in self.goals if goal.starts for start in self.starts)
        return frozenset(pairs | {(goal.id, number) for goal, number in limited if number not in goal.starts})

    def goal(self, name: str) -> SiteGoal | None:
        """Return the goal of the site file, or in a sequence, with that id; None: then the name is a category."""
        return next((part for goal in self.goals for part in (goal, *goal.parts) if part.id == name), None)

    @cached_property
    def goals_sha256(self) -> str:
        """Hash of the goals of the site file, for caches; empty without any."""
        hashes = "".join(sorted(goal.sha256 for goal in self.goals))
        return hashlib.sha256(hashes.encode()).hexdigest() if hashes else ""

    def start(self, number: int) -> StartingPosition:
        """Return the starting position with that number.

        Raises:
            UsageError: the site has none (`unknown-start`).
        """
        for start in self.starts:
            if start.number == number:
                return start
        known = ", ".join(str(start.number) for start in self.starts)
        raise UsageError(
            f"starting position {number} is not in site {self.name!r}", advice=f"it has {known}", code="unknown-start"
        )

    def content(self) -> dict[str, Any]:
        """Return the site as plain JSON values, as stored in the database; a scan counts by its hash."""
        return self.model_dump(mode="json", exclude={"scan": {"file"}})

    @cached_property
    def sha256(self) -> str:
        """Hash of the content, independent of comments and formatting of the file."""
        return content_sha256(self.content())


def embedded_sites() -> dict[str, Path]:
    """Return the files of the sites in the package, by name."""
    return {path.stem: path for path in sorted(resource_directory("sites").glob("*.yaml"))}


def load_site(name_or_path: str | Path) -> Site:
    """Read a site by the name of an embedded site or the path of a YAML file.

    Raises:
        UsageError: the site does not exist (`unknown-site`).
        SiteFileError: the file cannot be read or breaks the format; see `parse_settings` for the codes.
    """
    return read_settings(_site_file(name_or_path), Site, SiteFileError, "site")


def site_file_faults(name_or_path: str | Path) -> list[SettingsFault]:
    """Return all faults of a site file, with lines and fields.

    Raises:
        UsageError: the site does not exist (`unknown-site`).
        SiteFileError: the file cannot be read.
    """
    return settings_faults(_site_file(name_or_path), Site, SiteFileError, "site")


def _site_file(name_or_path: str | Path) -> Path:
    path = embedded_sites().get(str(name_or_path), Path(name_or_path))
    if not path.is_file():
        embedded = ", ".join(embedded_sites())
        advice = f"give an embedded site ({embedded}) or the path of a site file; `vsnbench init` writes one"
        if suggestion := closest(str(name_or_path), embedded_sites()):
            advice = f"did you mean {suggestion!r}?"
        raise UsageError(f"site {str(name_or_path)!r} does not exist", advice=advice, code="unknown-site")
    return path


def parse_site(text: str, origin: str, directory: Path | None = None) -> Site:
    """Read a site from YAML text; `origin` names it in errors, `directory` has the images of its goals.

    Raises:
        SiteFileError: the text breaks the format; see `parse_settings` for the codes.
    """
    return parse_settings(text, origin, Site, SiteFileError, "site", directory)
