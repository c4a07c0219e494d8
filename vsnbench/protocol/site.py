"""A surveyed place: rooms, walls, doors, objects and numbered starting positions, read from one YAML file.

World frame of a site: metres, x to the right and y up on the floor plan, headings in degrees counter-clockwise
from x. The file is the only description of the place: the judge measures distances in it and the simulator builds
its world from it.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)
from shapely import affinity
from shapely.geometry import LineString, Polygon, box
from shapely.validation import explain_validity

from vsnbench.errors import SiteError, UsageError
from vsnbench.protocol.categories import CATEGORIES, GOAL_CATEGORIES, meant_category
from vsnbench.protocol.length_unit import in_metres, near_enough
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.settings_file import CHECKING, SettingsFault, parse_settings, read_settings, settings_faults
from vsnbench.resources import resource_directory


def _goal_category(name: str) -> str:
    if name not in GOAL_CATEGORIES:
        raise ValueError(f"{name!r} is no goal category; they are {', '.join(GOAL_CATEGORIES)}")
    return name


GoalCategory = Annotated[str, AfterValidator(_goal_category)]
Coordinate = Annotated[float, AfterValidator(near_enough)]
Point = tuple[Coordinate, Coordinate]
Color = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy, with nothing kept that was worked out from the values before `update`."""
        copy = super().model_copy(update=update, deep=deep)
        for name in set(copy.__dict__) - set(type(self).model_fields):
            del copy.__dict__[name]
        return copy


class _Segment(_Strict):
    """Something straight between two different points on the floor plan."""

    start: Point
    end: Point

    @model_validator(mode="after")
    def _has_a_length(self) -> Self:
        if self.length_m < _SHORTEST_M:
            raise ValueError(f"start and end are the same place, {list(self.start)}")
        return self

    @property
    def length_m(self) -> float:
        """Distance between the two points, metres."""
        return math.dist(self.start, self.end)

    @property
    def centre_line(self) -> LineString:
        """The line between the two points."""
        return LineString([self.start, self.end])


_SHORTEST_M = 0.02
_SMALLEST_M2 = 1e-6


def _enclosing(outline: list[Point] | None) -> list[Point] | None:
    """Return the outline if it encloses an area."""
    if outline is not None:
        shape = Polygon(outline)
        if not shape.is_valid:
            raise ValueError(
                "the outline crosses itself: list its corners in the order in which one walks around it "
                f"({explain_validity(shape)})"
            )
        if shape.area < _SMALLEST_M2:
            raise ValueError("the outline encloses nothing")
    return outline


class Room(_Strict):
    """A room's outline on the floor plan, and what its floor and walls are made of."""

    name: str
    polygon: list[Point] = Field(min_length=3)
    floor: Literal["wood", "tiles", "carpet", "concrete"] = "wood"
    floor_color: Color | None = None

    _polygon_encloses = field_validator("polygon")(_enclosing)

    @cached_property
    def shape(self) -> Polygon:
        """The outline as a polygon, metres."""
        return Polygon(self.polygon)


class Wall(_Segment):
    """A straight wall between two points on its centre line; doors and windows on it are cut out of it."""

    thickness_m: float = Field(default=0.10, gt=0.01, lt=1)
    height_m: float | None = Field(default=None, gt=0.1, description="the site's ceiling height when absent")
    color: Color | None = None

    @cached_property
    def shape(self) -> Polygon:
        """The wall's footprint with no opening cut out; square ends reach half a thickness past both points."""
        return self.centre_line.buffer(self.thickness_m / 2, cap_style="square")


class Door(_Segment):
    """A doorway: the clear opening between two points on a wall's centre line.

    The leaf is hinged at `start` and swings to the left of start -> end; during trials it is folded back out of the
    way. A closed door, such as the front door, stays shut and is as impassable as the wall.
    """

    name: str
    height_m: float = Field(default=2.0, gt=1.0, lt=4)
    closed: bool = False

    @property
    def clear_width_m(self) -> float:
        """Width of the opening, metres."""
        return self.length_m


class Window(_Segment):
    """A window between two points on a wall's centre line; robots cannot pass it."""

    sill_m: float = Field(default=0.9, ge=0, lt=3)
    head_m: float = Field(default=2.1, gt=0, lt=4)

    @model_validator(mode="after")
    def _has_a_height(self) -> Self:
        if self.head_m <= self.sill_m:
            raise ValueError(f"its head at {self.head_m:g} m is not above its sill at {self.sill_m:g} m")
        return self


class SiteObject(_Strict):
    """A thing that stands in the site: goal instance or mere furniture.

    Its local frame is centred on its footprint; x (heading) is the side it faces: where one sits down, the screen of
    a monitor, the doors of a cabinet.
    """

    id: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    category: str
    position: Point
    heading_deg: float = 0.0
    size_m: tuple[
        Annotated[float, Field(ge=0.001, lt=20)],
        Annotated[float, Field(ge=0.001, lt=20)],
        Annotated[float, Field(ge=0.001, lt=5)],
    ] = Field(description="depth along its heading, width across it, height; metres")
    elevation_m: float = Field(default=0.0, ge=0, lt=4, description="underside above the floor, metres")
    footprint: list[Point] | None = Field(default=None, min_length=3, description="surveyed outline, world frame")
    model: str | None = Field(default=None, description="which look the simulator gives it; by category when absent")
    color: Color | None = None
    solid: bool = Field(default=True, description="whether a robot can collide with it (a rug is not)")

    _footprint_encloses = field_validator("footprint")(_enclosing)

    @field_validator("category")
    @classmethod
    def _category_is_known(cls, name: str, info: ValidationInfo) -> str:
        """Refuse an unknown one when a survey is checked; a record of another site keeps the categories that it has."""
        if info.context and info.context.get(CHECKING) and name not in CATEGORIES:
            raise ValueError(f"the unknown category {name!r}: {meant_category(name)}")
        return name

    @property
    def pose(self) -> Pose:
        """Centre and heading in the site's frame."""
        return Pose.from_degrees(*self.position, self.heading_deg)

    @cached_property
    def shape(self) -> Polygon:
        """The footprint on the floor plan: the surveyed outline, else the box of `size_m`."""
        if self.footprint is not None:
            return Polygon(self.footprint)
        depth, width, _ = self.size_m
        upright = box(-depth / 2, -width / 2, depth / 2, width / 2)
        turned = affinity.rotate(upright, self.heading_deg, origin=(0, 0))
        return affinity.translate(turned, *self.position)


class StartingPosition(_Strict):
    """A numbered place and heading from which episodes start (paper, Figure 3: the floor plan)."""

    number: int = Field(ge=1, le=9999)
    position: Point
    heading_deg: float
    note: str = ""
    not_for: list[GoalCategory] = Field(default=[], description="goals that no trial searches from here")

    @model_serializer(mode="wrap")
    def _without_what_it_does_not_say(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave an empty `not_for` out: sites keep the hash that they had before there was one."""
        content: dict[str, Any] = serialize(self)
        return content if self.not_for else {name: value for name, value in content.items() if name != "not_for"}

    @property
    def pose(self) -> Pose:
        """Place and heading in the site's frame."""
        return Pose.from_degrees(*self.position, self.heading_deg)


class Site(_Strict):
    """A whole surveyed place."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    title: str = ""
    ceiling_height_m: float = Field(default=2.5, gt=1.5, lt=10)
    survey_error_m: float = Field(default=0.01, gt=0, le=0.2, description="standard deviation of walls; objects twice")
    rooms: list[Room] = Field(min_length=1)
    walls: list[Wall] = Field(min_length=1)
    doors: list[Door] = []
    windows: list[Window] = []
    objects: list[SiteObject] = []
    starts: list[StartingPosition] = Field(min_length=1)

    _is_in_metres = model_validator(mode="before")(in_metres)

    @field_validator("rooms", "doors", "objects", "starts")
    @classmethod
    def _names_are_unique(cls, things: list[Any], info: ValidationInfo) -> list[Any]:
        key = {"objects": "id", "starts": "number"}.get(info.field_name or "", "name")
        names = [str(getattr(thing, key)) for thing in things]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)} is given more than once")
        return things

    @model_serializer(mode="wrap")
    def _without_a_usual_survey(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave the default of `survey_error_m` out: sites keep the hash that they had before there was one."""
        content: dict[str, Any] = serialize(self)
        if self.survey_error_m == type(self).model_fields["survey_error_m"].default:
            content.pop("survey_error_m", None)
        return content

    @property
    def area_m2(self) -> float:
        """Floor area of all rooms, square metres."""
        return float(sum(room.shape.area for room in self.rooms))

    @property
    def categories(self) -> frozenset[str]:
        """The categories of the objects that stand here."""
        return frozenset(thing.category for thing in self.objects)

    def instances(self, category: str) -> list[SiteObject]:
        """Return the objects of a category; empty when there are none."""
        return [thing for thing in self.objects if thing.category == category]

    @property
    def excluded(self) -> frozenset[tuple[str, int]]:
        """The goals, each with a starting position's number, that are no trials here."""
        return frozenset((goal, start.number) for start in self.starts for goal in start.not_for)

    def start(self, number: int) -> StartingPosition:
        """Return the starting position with that number.

        Raises:
            UsageError: there is none.
        """
        for start in self.starts:
            if start.number == number:
                return start
        known = ", ".join(str(start.number) for start in self.starts)
        raise UsageError(f"site {self.name} has no starting position {number}; it has {known}")

    def content(self) -> dict[str, Any]:
        """Return the site as plain JSON values: what the database keeps."""
        return self.model_dump(mode="json")

    @cached_property
    def sha256(self) -> str:
        """Hash of the content, independent of comments and formatting in the file."""
        return hashlib.sha256(json.dumps(self.content(), sort_keys=True).encode()).hexdigest()


def embedded_sites() -> dict[str, Path]:
    """Return the sites that ship with vsnbench, by name."""
    return {path.stem: path for path in sorted(resource_directory("sites").glob("*.yaml"))}


def load_site(name_or_path: str | Path) -> Site:
    """Read an embedded site by its name, or any site by the path of its YAML file.

    Raises:
        UsageError: there is no such site.
        SiteError: the file cannot be read or breaks the format; the message names the line and the field.
    """
    return read_settings(_site_file(name_or_path), Site, SiteError, "site")


def site_file_faults(name_or_path: str | Path) -> list[SettingsFault]:
    """Return everything in which a site's file breaks the format, with lines and fields; empty for a good one.

    Raises:
        UsageError: there is no such site.
        SiteError: the file cannot be read.
    """
    return settings_faults(_site_file(name_or_path), Site, SiteError, "site")


def _site_file(name_or_path: str | Path) -> Path:
    path = embedded_sites().get(str(name_or_path), Path(name_or_path))
    if not path.is_file():
        known = ", ".join(embedded_sites())
        raise UsageError(
            f"no site {str(name_or_path)!r}", advice=f"name an embedded one ({known}) or the path of a site file"
        )
    return path


def parse_site(text: str, origin: str) -> Site:
    """Read a site from YAML text; `origin` names it in errors.

    Raises:
        SiteError: the text breaks the format; the message names the line and the field.
    """
    return parse_settings(text, origin, Site, SiteError, "site")
