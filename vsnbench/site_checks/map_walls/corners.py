"""Alignment of proposed walls: right angles where they nearly are, corners where ends nearly meet."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.site_checks.map_walls.grid import FREE, PlanGrid

_NEARLY_RAD: Final = math.radians(3)
"""Maximum deviation from a right angle that is corrected: short lines deviate this much by chance."""
_TURN_STEP_RAD: Final = math.radians(0.1)
_SQUARE_RAD: Final = math.radians(0.4)
"""Maximum deviation from the frame's axes that is corrected."""
_CROSSING_RAD: Final = math.radians(30)
_REACH_M, _OVERSHOT_M = 0.8, 0.4
"""Maximum extension of a wall to a corner, through cells that are not known to be free, and maximum shortening."""
_HIDDEN: Final = 0.7
"""Minimum share of the cells between a wall and its corner that are not known to be free."""

Point = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class WallLine:
    """A proposed wall: the ends of its centre line, metres in the site's frame."""

    start: tuple[float, float]
    end: tuple[float, float]
    thickness_m: float
    doorways: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = ()
    """The ends of each clear opening, on the centre line."""

    @property
    def length_m(self) -> float:
        """Distance between the ends, metres."""
        return math.dist(self.start, self.end)


def main_direction(points: Point, about_rad: float) -> float:
    """Return the main direction of walls, refined from an estimate.

    Args:
        points: (n, 2) occupied cells, in cells.
        about_rad: estimate of the direction, within 3 degrees.

    Returns:
        The direction that maximizes the sum of squared histogram counts along and across it, radians.
    """
    best_rad, most = about_rad, 0.0
    for angle_rad in about_rad + np.arange(-_NEARLY_RAD, _NEARLY_RAD, _TURN_STEP_RAD):
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        turned = points @ np.array([[cos, -sin], [sin, cos]])
        lines = [np.bincount(np.floor(axis - axis.min()).astype(int)) for axis in turned.T]
        if (sharp := sum(float((line.astype(np.float64) ** 2).sum()) for line in lines)) > most:
            best_rad, most = float(angle_rad), sharp
    return best_rad


def straightened(line: WallLine, main_rad: float) -> WallLine:
    """Return a wall rotated about its centre to the main direction or across it, if it nearly has this direction."""
    along = np.array(line.end) - line.start
    axis_rad = round(main_rad / (math.pi / 2)) * (math.pi / 2)
    if abs(main_rad - axis_rad) < _SQUARE_RAD:
        main_rad = axis_rad
    angle_rad = math.atan2(along[1], along[0])
    off_rad = math.remainder(angle_rad - main_rad, math.pi / 2)
    if abs(off_rad) > _NEARLY_RAD:
        return line
    middle, half_m = (np.array(line.start) + line.end) / 2, line.length_m / 2
    way = np.array([math.cos(angle_rad - off_rad), math.sin(angle_rad - off_rad)])
    openings = [
        [_pair(middle + way * float((np.array(jamb) - middle) @ way)) for jamb in jambs] for jambs in line.doorways
    ]
    return replace(
        line,
        start=_pair(middle - way * half_m),
        end=_pair(middle + way * half_m),
        doorways=tuple((first, last) for first, last in openings),
    )


def with_closed_corners(walls: list[WallLine], grid: PlanGrid) -> list[WallLine]:
    """Return walls with each end moved onto the centre line of a wall that it nearly meets, unless cells between
    them are known to be free. A wall of which this leaves less than a cell is left out.
    """
    closed = []
    for wall in walls:
        start = _corner(np.array(wall.start), np.array(wall.end), wall, walls, grid)
        end = _corner(np.array(wall.end), np.array(wall.start), wall, walls, grid)
        if float((end - start) @ (np.array(wall.end) - wall.start)) > grid.resolution_m * wall.length_m:
            closed.append(replace(wall, start=_pair(start), end=_pair(end)))
    return closed


def _corner(end: Point, other_end: Point, wall: WallLine, walls: list[WallLine], grid: PlanGrid) -> Point:
    """Return the corner that an end of a wall belongs to, or the end itself."""
    way = (end - other_end) / math.dist(end, other_end)
    best, least = end, math.inf
    for crossing in walls:
        if crossing is wall:
            continue
        along = (np.array(crossing.end) - crossing.start) / crossing.length_m
        sine = float(way[0] * along[1] - way[1] * along[0])
        if abs(sine) < math.sin(_CROSSING_RAD):
            continue
        between = np.array(crossing.start) - end
        further_m = float(between[0] * along[1] - between[1] * along[0]) / sine
        at = end + way * further_m
        past_m = float((at - crossing.start) @ along)
        if not -_REACH_M <= past_m <= crossing.length_m + _REACH_M:
            continue
        is_free = further_m > 0 and not _hidden(end, at, grid)
        if -_OVERSHOT_M <= further_m <= _REACH_M and abs(further_m) < least and not is_free:
            best, least = at, abs(further_m)
    return best


def _hidden(end: Point, at: Point, grid: PlanGrid) -> bool:
    """Whether most cells from a wall's end to a corner are not known to be free."""
    share = np.linspace(0.0, 1.0, 2 + int(math.dist(end, at) / grid.resolution_m))[:, None]
    return float(np.mean(grid.cells_at(end + share * (at - end)) != FREE)) >= _HIDDEN


def _pair(point: Point) -> tuple[float, float]:
    x, y = point.tolist()
    return (x, y)
