"""A site as things that are drawn, each of a kind, with points and properties: what GeoJSON and SVG have in common.

A room is an outline, a wall, door or window a line, what stands there the outline of its footprint, a start a point.
Points are metres in the site's frame; what a drawing cannot show is in the properties, by the names of a site file.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

from pydantic import ValidationError

from vsnbench.errors import SiteError
from vsnbench.protocol.field_faults import words_of
from vsnbench.protocol.settings_file import CHECKING
from vsnbench.protocol.site import Site

Point = tuple[float, float]
Content = dict[str, Any]

KINDS: Final = {
    "room": "rooms",
    "wall": "walls",
    "door": "doors",
    "window": "windows",
    "object": "objects",
    "start": "starts",
}
"""What a thing may be, and the list of a site file that it is in."""
HEAD: Final = ("name", "title", "ceiling_height_m", "survey_error_m")
OUTLINE: Final = "outline"
"""Property of an object whose outline was surveyed: it is no box, even where it looks like one."""
MOST_FEATURES = 5_000
"""So many things with so many corners stay within what a site file may hold."""
MOST_CORNERS = 50_000
MOST_CHARACTERS = 4_000_000
"""Longer files are refused unread: a flat has some 30,000."""

_SAME_M = 0.005
_SAME_RAD = math.radians(0.05)


@dataclass(frozen=True, slots=True)
class Feature:
    """One thing of a drawing."""

    kind: str
    """A key of `KINDS`."""
    points: tuple[Point, ...]
    """An outline's corners (the first is not given again), the points of a line, or one place."""
    closed: bool
    properties: Content = field(default_factory=dict)
    where: str = ""
    """In which part of the file, for errors."""


def features_of(site: Site) -> list[Feature]:
    """Return everything in a site, in the order of its file."""
    content = site.model_dump(mode="json", exclude_defaults=True)
    return [_feature(kind, entry) for kind, name in KINDS.items() for entry in content.get(name, ())]


def head_of(site: Site) -> Content:
    """Return what a site says of itself as a whole."""
    return {name: value for name, value in site.model_dump(mode="json", exclude_defaults=True).items() if name in HEAD}


def box_corners(position: Point, heading_deg: float, depth_m: float, width_m: float) -> tuple[Point, ...]:
    """Return the corners of a turned box, counter-clockwise; its first side points along the heading."""
    forward = (math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg)))
    half = ((-depth_m / 2, -width_m / 2), (depth_m / 2, -width_m / 2), (depth_m / 2, width_m / 2))
    return tuple(
        (
            round(position[0] + ahead * forward[0] - aside * forward[1], 9),
            round(position[1] + ahead * forward[1] + aside * forward[0], 9),
        )
        for ahead, aside in (*half, (-depth_m / 2, width_m / 2))
    )


def content_of(features: Iterable[Feature], head: Content, origin: str) -> tuple[Content, tuple[str, ...]]:
    """Return the content of a site's file, and the names of the lists that it still lacks to be a site.

    Raises:
        SiteError: something breaks the format of a site; the message names the thing and the field.
    """
    content: Content = {**head, **{name: [] for name in KINDS.values()}}
    origins: dict[tuple[str, int], str] = {}
    corners = 0
    for feature in features:
        corners += len(feature.points)
        if corners > MOST_CORNERS:
            raise SiteError(f"{origin}: it has more than {MOST_CORNERS:,} corners")
        entries = content[KINDS[feature.kind]]
        for entry in _entries(feature, f"{origin}: {feature.where}", len(entries) + 1):
            origins[KINDS[feature.kind], len(entries)] = feature.where
            entries.append(entry)
        if len(origins) > MOST_FEATURES:
            raise SiteError(f"{origin}: it has more than {MOST_FEATURES:,} things")
    lacks: list[str] = []
    try:
        Site.model_validate(content, context={CHECKING: True})
    except ValidationError as problem:
        # A misspelt field is missing under its right name too: the misspelling is what helps.
        for one in sorted(problem.errors(), key=lambda one: one["type"] != "extra_forbidden"):
            place = one["loc"]
            if one["type"] == "too_short" and len(place) == 1:
                lacks.append(str(place[0]))
                continue
            where = origins.get((str(place[0]), int(place[1])), "") if len(place) > 1 else ""
            said = [origin, where, ".".join(str(part) for part in (place[2:] if where else place))]
            statement, mend = words_of(one, Site)
            raise SiteError(": ".join([*filter(None, said), statement]), advice=mend) from problem
    return content, tuple(lacks)


def _feature(kind: str, entry: Content) -> Feature:
    if kind == "room":
        return Feature(kind, _points(entry.pop("polygon")), True, entry)
    if kind == "start":
        return Feature(kind, _points([entry.pop("position")]), False, entry)
    if kind != "object":
        return Feature(kind, _points([entry.pop("start"), entry.pop("end")]), False, entry)
    if "footprint" in entry:
        return Feature(kind, _points(entry.pop("footprint")), True, {**entry, OUTLINE: True})
    depth_m, width_m, _ = entry["size_m"]
    corners = box_corners(entry["position"], entry.get("heading_deg", 0.0), depth_m, width_m)
    return Feature(kind, corners, True, entry)


def _points(pairs: Iterable[Any]) -> tuple[Point, ...]:
    return tuple((float(x_m), float(y_m)) for x_m, y_m in pairs)


def _entries(feature: Feature, where: str, number: int) -> list[Content]:
    given, points = dict(feature.properties), [list(point) for point in feature.points]
    if feature.kind == "room":
        _shape(feature.closed, where, "a room is an outline, not a line or a point")
        return [{"name": f"room {number}", **given, "polygon": points}]
    if feature.kind == "object":
        return [_object(feature, given, where, number)]
    _shape(not feature.closed, where, f"a {feature.kind} is no outline", "walls are drawn along their centre line")
    if feature.kind == "start":
        _shape(len(points) == 1, where, "a start is one point")
        return [{"number": number, **given, "position": points[0]}]
    _shape(len(points) > 1, where, f"a {feature.kind} is a line, not a point")
    if feature.kind == "wall":
        return [{**given, "start": start, "end": end} for start, end in pairwise(points)]
    _shape(len(points) == 2, where, f"a {feature.kind} is a line of two points, this has {len(points)}")
    name = {"name": f"door {number}"} if feature.kind == "door" else {}
    return [{**name, **given, "start": points[0], "end": points[1]}]


def _object(feature: Feature, given: Content, where: str, number: int) -> Content:
    surveyed = given.pop(OUTLINE, False) is True
    name = {} if "id" in given else {"id": f"{given.get('category', 'object')}-{number}"}
    entry = {**name, **given}
    if len(feature.points) == 1:
        return {**entry, "position": list(feature.points[0])}
    _shape(feature.closed, where, "an object is an outline or a point, not a line")
    _shape(_numbers(given.get("size_m"), 3), where, "size_m is [depth, width, height] in metres")
    heading_deg = given.get("heading_deg", 0.0)
    _shape(_numbers([heading_deg], 1), where, "heading_deg is a number")
    corners = feature.points
    middle = [sum(corner[axis] for corner in corners) / len(corners) for axis in (0, 1)]
    if surveyed or not _is_box(corners):
        return {"position": [round(value, 4) for value in middle], **entry, "footprint": [list(c) for c in corners]}
    position = given.get("position")
    same_place = _numbers(position, 2) and math.dist(position, middle) < _SAME_M  # type: ignore[arg-type]
    first = math.atan2(corners[1][1] - corners[0][1], corners[1][0] - corners[0][0])
    sides = [math.dist(corners[0], corners[1]), math.dist(corners[1], corners[2])]
    turned = math.remainder(first - math.radians(heading_deg), math.tau)
    _shape(
        abs(turned) < math.pi / 4,
        where,
        f"it is drawn turned by {math.degrees(turned):.0f}° from its heading_deg, {heading_deg:g}",
        f"write heading_deg: {math.degrees(first):.0f}, or begin its outline with a side along the heading",
    )
    size_m = given["size_m"]
    entry["position"] = position if same_place else [round(value, 4) for value in middle]
    if abs(turned) > _SAME_RAD:
        entry["heading_deg"] = round(math.degrees(first), 3)
    if any(abs(drawn - said) > _SAME_M for drawn, said in zip(sides, size_m, strict=False)):
        entry["size_m"] = [*(round(side, 4) for side in sides), size_m[2]]
    return entry


def _is_box(corners: tuple[Point, ...]) -> bool:
    if len(corners) != 4:
        return False
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = corners
    along, aside = (bx - ax, by - ay), (cx - bx, cy - by)
    closes = math.hypot(ax + cx - bx - dx, ay + cy - by - dy) < _SAME_M
    square = abs(along[0] * aside[0] + along[1] * aside[1]) < _SAME_M * max(math.hypot(*along), math.hypot(*aside))
    return closes and square and along[0] * aside[1] > along[1] * aside[0]


def _numbers(value: object, count: int) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == count
        and all(isinstance(each, int | float) and not isinstance(each, bool) for each in value)
    )


def _shape(sound: bool, where: str, problem: str, advice: str = "") -> None:
    if not sound:
        raise SiteError(f"{where}: {problem}", advice=advice)
