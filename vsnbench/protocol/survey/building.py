"""What is wrong with the walls, doors and windows of a surveyed site: missing, doubled, out of place."""

import itertools
import math
from collections.abc import Iterator

import shapely

from vsnbench.protocol.site import Door, Point, Site, Wall, Window
from vsnbench.protocol.survey.finding import (
    Amount,
    Entry,
    Severity,
    SiteFinding,
    between,
    points,
    stretch,
)
from vsnbench.protocol.walls import walls_of

_RUN_TOGETHER_M = 0.04
"""Openings may share so much of their wall before they count as being in the same place."""
_PARALLEL_RAD = math.radians(5)
_WIDEST_DOOR_M = 4.0
_FEET_M = 0.3048


def building_findings(site: Site) -> Iterator[SiteFinding]:
    """Yield what is wrong with walls, doors and windows."""
    yield from _walls(site)
    for index, door in enumerate(site.doors):
        yield from _opening(site, door, named_door(door), door.height_m, ("doors", index))
    for index, window in enumerate(site.windows):
        yield from _opening(site, window, f"window {index + 1}", window.head_m, ("windows", index))
    yield from _openings_in_one_place(site)
    yield from _doors_to_nowhere(site)
    yield from _ceiling(site)


def named_door(door: Door) -> str:
    """Return a door as findings call it."""
    return f"door `{door.name}`"


def named_wall(site: Site, index: int) -> str:
    """Return a wall as findings call it: by its number, from 1, and its ends."""
    wall = site.walls[index]
    return f"wall {index + 1} ({between(wall.start, wall.end)})"


def _walls(site: Site) -> Iterator[SiteFinding]:
    for (i, one), (j, other) in itertools.combinations(enumerate(site.walls), 2):
        length_m = _shared_length_m(one, other)
        if length_m > 0:
            yield SiteFinding(
                Severity.ERROR,
                "walls-overlap",
                f"{named_wall(site, i)} and {named_wall(site, j)}",
                f"overlap along {length_m:.2f} m",
                "delete one of them" if length_m > 0.95 * min(one.length_m, other.length_m) else "shorten one of them",
                stretch(other.start, other.end),
                Amount(length_m),
                (("walls", i), ("walls", j)),
            )
    for index, wall in enumerate(site.walls):
        over_m = 0.0 if wall.height_m is None else wall.height_m - site.ceiling_height_m
        if over_m > 1e-6:
            yield SiteFinding(
                Severity.ERROR,
                "wall-above-ceiling",
                named_wall(site, index),
                f"is {wall.height_m:g} m high, {over_m:.2f} m above the ceiling",
                "leave height_m out for a wall up to the ceiling",
                stretch(wall.start, wall.end),
                Amount(over_m),
                (("walls", index),),
            )


def _shared_length_m(one: Wall, other: Wall) -> float:
    """Return along how many metres two walls run in the same place; 0 for walls that merely meet or cross."""
    if angle_rad(one.start, one.end, other) > _PARALLEL_RAD:
        return 0.0
    strip = one.centre_line.buffer((one.thickness_m + other.thickness_m) / 2 - 1e-3, cap_style="flat")
    length_m = float(strip.intersection(other.centre_line).length)
    return length_m if length_m > (one.thickness_m + other.thickness_m) / 2 else 0.0


def angle_rad(start: Point, end: Point, wall: Wall) -> float:
    """Return the angle between a stretch and a wall, 0 to pi/2."""
    across = (end[0] - start[0]) * (wall.end[1] - wall.start[1]) - (end[1] - start[1]) * (wall.end[0] - wall.start[0])
    return math.asin(min(1.0, abs(across) / (math.dist(start, end) * wall.length_m)))


def _opening(site: Site, opening: Door | Window, name: str, top_m: float, entry: Entry) -> Iterator[SiteFinding]:
    ends = (opening.start, opening.end)
    walls = walls_of(site, *ends)
    if not walls:
        off_m, mend = _nearest_wall(site, opening)
        yield SiteFinding(
            Severity.ERROR,
            "opening-off-wall",
            name,
            f"({between(*ends)}) lies on no wall",
            mend,
            stretch(*ends),
            Amount(off_m),
            (entry,),
        )
        return
    height_m = min(site.ceiling_height_m if wall.height_m is None else wall.height_m for wall in walls)
    if top_m > height_m + 1e-6:
        field = "height_m" if isinstance(opening, Door) else "head_m"
        yield SiteFinding(
            Severity.ERROR,
            "opening-above-wall",
            name,
            f"({between(*ends)}) reaches {top_m - height_m:.2f} m above its wall, which is {height_m:g} m high",
            f"measure both again; its {field} is {height_m:g} at most",
            stretch(*ends),
            Amount(top_m - height_m),
            (entry,),
        )


def _nearest_wall(site: Site, opening: Door | Window) -> tuple[float, str]:
    """Return how far the wall that was likely meant is, and how to move the opening on to it."""

    def off_m(index: int) -> float:
        line = site.walls[index].centre_line
        return max(float(line.distance(shapely.Point(end))) for end in (opening.start, opening.end))

    index = min(range(len(site.walls)), key=off_m)
    line = site.walls[index].centre_line
    first, last = (line.interpolate(line.project(shapely.Point(end))).coords[0] for end in (opening.start, opening.end))
    where = f"the centre line of {named_wall(site, index)} is {off_m(index):.2f} m away"
    if math.dist(first, last) > 0.9 * opening.length_m:
        x0, y0, x1, y1 = (round(value, 3) + 0.0 for value in (*first, *last))
        return off_m(index), f"{where}; on it the opening is start: [{x0:g}, {y0:g}], end: [{x1:g}, {y1:g}]"
    return off_m(index), f"{where}; make that wall longer, add the wall, or measure the opening again"


def _openings_in_one_place(site: Site) -> Iterator[SiteFinding]:
    openings: list[tuple[str, Door | Window, Entry]] = [
        (named_door(door), door, ("doors", index)) for index, door in enumerate(site.doors)
    ]
    openings += [(f"window {index + 1}", window, ("windows", index)) for index, window in enumerate(site.windows)]
    for (name, one, entry), (other_name, other, other_entry) in itertools.combinations(openings, 2):
        shared = one.centre_line.buffer(0.01).intersection(other.centre_line)
        if shared.length > _RUN_TOGETHER_M:
            (x0, y0), *_, (x1, y1) = shared.coords
            yield SiteFinding(
                Severity.ERROR,
                "openings-overlap",
                f"{name} and {other_name}",
                f"overlap along {shared.length:.2f} m, {between((x0, y0), (x1, y1))}",
                "measure the clear openings again, or delete one",
                stretch((x0, y0), (x1, y1)),
                Amount(float(shared.length)),
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
                named_door(door),
                f"({between(door.start, door.end)}) stands open and leads out of every room",
                "mark it closed: true and shut it, or survey what lies behind",
                stretch(door.start, door.end),
                entries=(("doors", index),),
            )


def _ceiling(site: Site) -> Iterator[SiteFinding]:
    """Doors wider than any and a ceiling higher than most are a survey in feet."""
    wide = [door for door in site.doors if door.clear_width_m > 2]
    if site.ceiling_height_m > 6 and site.doors and len(wide) == len(site.doors):
        yield SiteFinding(
            Severity.WARNING,
            "lengths-in-feet",
            f"site {site.name}",
            f"has a ceiling of {site.ceiling_height_m:g} and doors of {wide[0].clear_width_m:.2f} and more",
            f"these look like feet; lengths are metres, so that is {site.ceiling_height_m * _FEET_M:.2f} "
            f"and {wide[0].clear_width_m * _FEET_M:.2f}",
        )
        return
    for index, door in enumerate(site.doors):
        if door.clear_width_m > _WIDEST_DOOR_M:
            yield SiteFinding(
                Severity.WARNING,
                "door-very-wide",
                named_door(door),
                f"({between(door.start, door.end)}) is {door.clear_width_m:.2f} m wide",
                "measure it again between the jambs",
                points(door.start, door.end),
                Amount(door.clear_width_m),
                (("doors", index),),
            )
