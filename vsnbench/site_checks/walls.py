"""Checks of walls, doors and windows: overlaps, heights, openings off their walls."""

import itertools
import math
from collections.abc import Iterator

import shapely

from vsnbench.site_checks.finding import Entry, Severity, SiteFinding, points, range_text, stretch
from vsnbench.sites.fields import Point
from vsnbench.sites.geometry.walls import walls_of
from vsnbench.sites.site import Door, Site, Wall, Window

_RUN_TOGETHER_M = 0.04
"""Maximum overlap of two openings in a wall."""
_PARALLEL_RAD = math.radians(5)
_WIDEST_DOOR_M = 4.0
_FEET_M = 0.3048


def wall_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield findings about walls, doors and windows."""
    yield from _walls(site)
    for name, opening, entry in _openings(site):
        yield from _opening(site, opening, name, entry)
    yield from _openings_in_one_place(site)
    yield from _doors_to_nowhere(site)
    yield from _ceiling(site)


def door_name(door: Door) -> str:
    """Return the name of a door in findings."""
    return f"door `{door.name}`"


def wall_name(site: Site, index: int) -> str:
    """Return the name of a wall in findings: its number, from 1, and its ends."""
    wall = site.walls[index]
    return f"wall {index + 1} ({range_text(wall.start, wall.end)})"


def _walls(site: Site) -> Iterator[SiteFinding]:
    for (i, wall), (j, other) in itertools.combinations(enumerate(site.walls), 2):
        length_m = _shared_length_m(wall, other)
        if length_m > 0:
            yield SiteFinding(
                Severity.ERROR,
                "walls-overlap",
                f"{wall_name(site, i)} and {wall_name(site, j)}",
                f"overlap along {length_m:.2f} m",
                "delete one of them" if length_m > 0.95 * min(wall.length_m, other.length_m) else "shorten one of them",
                stretch(other.start, other.end),
                length_m,
                (("walls", i), ("walls", j)),
            )
    for index, wall in enumerate(site.walls):
        over_m = 0.0 if wall.height_m is None else wall.height_m - site.ceiling_height_m
        if over_m > 1e-6:
            yield SiteFinding(
                Severity.ERROR,
                "wall-above-ceiling",
                wall_name(site, index),
                f"is {wall.height_m:g} m high, {over_m:.2f} m above the ceiling",
                "omit height_m for a wall up to the ceiling",
                stretch(wall.start, wall.end),
                over_m,
                (("walls", index),),
            )


def _shared_length_m(wall: Wall, other: Wall) -> float:
    """Return the length along which two parallel walls overlap, metres; 0 for walls that only meet or cross."""
    if angle_rad(wall.start, wall.end, other) > _PARALLEL_RAD:
        return 0.0
    mean_thickness_m = (wall.thickness_m + other.thickness_m) / 2
    strip = wall.centre_line.buffer(mean_thickness_m - 1e-3, cap_style="flat")
    length_m = float(strip.intersection(other.centre_line).length)
    return length_m if length_m > mean_thickness_m else 0.0


def angle_rad(start: Point, end: Point, wall: Wall) -> float:
    """Return the angle between a line and a wall, 0 to pi/2."""
    across = (end[0] - start[0]) * (wall.end[1] - wall.start[1]) - (end[1] - start[1]) * (wall.end[0] - wall.start[0])
    return math.asin(min(1.0, abs(across) / (math.dist(start, end) * wall.length_m)))


def _openings(site: Site) -> list[tuple[str, Door | Window, Entry]]:
    """Return doors and windows with their names and entries."""
    doors: list[tuple[str, Door | Window, Entry]] = [
        (door_name(door), door, ("doors", index)) for index, door in enumerate(site.doors)
    ]
    return doors + [(f"window {index + 1}", window, ("windows", index)) for index, window in enumerate(site.windows)]


def _opening(site: Site, opening: Door | Window, name: str, entry: Entry) -> Iterator[SiteFinding]:
    ends = (opening.start, opening.end)
    walls = walls_of(site, *ends)
    if not walls:
        off_m, advice = _nearest_wall(site, opening)
        yield SiteFinding(
            Severity.ERROR,
            "opening-off-wall",
            name,
            f"({range_text(*ends)}) is not on a wall",
            advice,
            stretch(*ends),
            off_m,
            (entry,),
        )
        return
    height_m = min(site.ceiling_height_m if wall.height_m is None else wall.height_m for wall in walls)
    field, top_m = ("height_m", opening.height_m) if isinstance(opening, Door) else ("head_m", opening.head_m)
    if top_m > height_m + 1e-6:
        yield SiteFinding(
            Severity.ERROR,
            "opening-above-wall",
            name,
            f"({range_text(*ends)}) reaches {top_m - height_m:.2f} m above its wall, which is {height_m:g} m high",
            f"measure both again; its {field} can be at most {height_m:g}",
            stretch(*ends),
            top_m - height_m,
            (entry,),
        )


def _nearest_wall(site: Site, opening: Door | Window) -> tuple[float, str]:
    """Return the distance of the nearest wall and advice to move the opening onto it."""

    def off_m(index: int) -> float:
        line = site.walls[index].centre_line
        return max(float(line.distance(shapely.Point(end))) for end in (opening.start, opening.end))

    index = min(range(len(site.walls)), key=off_m)
    line = site.walls[index].centre_line
    first, last = (line.interpolate(line.project(shapely.Point(end))).coords[0] for end in (opening.start, opening.end))
    where = f"the centre line of {wall_name(site, index)} is {off_m(index):.2f} m away"
    if math.dist(first, last) > 0.9 * opening.length_m:
        x0, y0, x1, y1 = (round(value, 3) + 0.0 for value in (*first, *last))
        return off_m(index), f"{where}; on it the opening is start: [{x0:g}, {y0:g}], end: [{x1:g}, {y1:g}]"
    return off_m(index), f"{where}; extend this wall, add a wall, or measure the opening again"


def _openings_in_one_place(site: Site) -> Iterator[SiteFinding]:
    for (name, opening, entry), (other_name, other, other_entry) in itertools.combinations(_openings(site), 2):
        shared = opening.centre_line.buffer(0.01).intersection(other.centre_line)
        if shared.length > _RUN_TOGETHER_M:
            (x0, y0), *_, (x1, y1) = shared.coords
            yield SiteFinding(
                Severity.ERROR,
                "openings-overlap",
                f"{name} and {other_name}",
                f"overlap along {shared.length:.2f} m, {range_text((x0, y0), (x1, y1))}",
                "measure the clear openings again, or delete one of them",
                stretch((x0, y0), (x1, y1)),
                float(shared.length),
                (entry, other_entry),
            )


def _doors_to_nowhere(site: Site) -> Iterator[SiteFinding]:
    rooms = shapely.union_all([room.shape for room in site.rooms])
    for index, door in enumerate(site.doors):
        walls = walls_of(site, door.start, door.end)
        if door.closed or not walls:
            continue
        across_m = max(wall.thickness_m for wall in walls) / 2 + 0.1
        sides = [door.centre_line.parallel_offset(across_m, side) for side in ("left", "right")]
        if not all(rooms.intersects(side) for side in sides):
            yield SiteFinding(
                Severity.WARNING,
                "door-to-nowhere",
                door_name(door),
                f"({range_text(door.start, door.end)}) is open and leads out of all rooms",
                "mark it closed: true and close it, or survey the room behind it",
                stretch(door.start, door.end),
                entries=(("doors", index),),
            )


def _ceiling(site: Site) -> Iterator[SiteFinding]:
    """Yield a warning for lengths that look like feet, or for each very wide door."""
    wide = [door for door in site.doors if door.length_m > 2]
    if site.ceiling_height_m > 6 and site.doors and len(wide) == len(site.doors):
        yield SiteFinding(
            Severity.WARNING,
            "lengths-in-feet",
            f"site {site.name}",
            f"has a ceiling of {site.ceiling_height_m:g} and doors of {wide[0].length_m:.2f} and more",
            f"these look like feet; in metres they are {site.ceiling_height_m * _FEET_M:.2f} "
            f"and {wide[0].length_m * _FEET_M:.2f}",
        )
        return
    for index, door in enumerate(site.doors):
        if door.length_m > _WIDEST_DOOR_M:
            yield SiteFinding(
                Severity.WARNING,
                "door-very-wide",
                door_name(door),
                f"({range_text(door.start, door.end)}) is {door.length_m:.2f} m wide",
                "measure the clear opening between the jambs again",
                points(door.start, door.end),
                door.length_m,
                (("doors", index),),
            )
