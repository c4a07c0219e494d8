"""Where a round robot can stand in a site, and how far it is from there to a goal: the shortest path that SPL needs."""

import math
from importlib.metadata import version
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.machine_cache import code_key, kept_array, key_of
from vsnbench.protocol import judge, sight, walls
from vsnbench.protocol.judge import success_regions
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site
from vsnbench.protocol.walls import TOUCH_HEIGHT_M, solid_shapes

RESOLUTION_M = 0.025
"""Side of a grid cell."""
_REACH_CELLS = 4
"""A start this near to the free space (in cells) counts as standing in it: surveys are not exact to a centimetre."""

_PAPER = ProtocolParameters()

_TILE = 16
"""Cells on the side of a tile."""
_BAND_M = 4 * RESOLUTION_M
"""Farther from where success begins only its side matters."""
_OUTLINE_M = 1e-3
"""Outlines of regions are polygons: nearer than this to one is in it."""

FloatGrid = npt.NDArray[np.float64]
BoolGrid = npt.NDArray[np.bool_]


class FreeSpace:
    """The floor plan as a grid of where the centre of a round robot can be.

    `cells[row, column]` stands for the point (origin_x_m + column * RESOLUTION_M, origin_y_m + row * RESOLUTION_M).
    Make it with `free_space`, which keeps the last ones.
    """

    def __init__(self, site: Site, robot_radius_m: float, robot_height_m: float = TOUCH_HEIGHT_M) -> None:
        """Lay the grid over the site's rooms; takes about a quarter of a second, once a machine."""
        self.site = site
        self.robot_radius_m = robot_radius_m
        rooms = shapely.union_all([room.shape for room in site.rooms])
        x_min, y_min, x_max, y_max = rooms.bounds
        self.origin_x_m, self.origin_y_m = x_min, y_min
        columns = math.ceil((x_max - x_min) / RESOLUTION_M) + 1
        rows = math.ceil((y_max - y_min) / RESOLUTION_M) + 1
        xs = x_min + RESOLUTION_M * np.arange(columns)
        ys = y_min + RESOLUTION_M * np.arange(rows)
        self.x_m, self.y_m = np.meshgrid(xs, ys)
        self._solids = np.asarray(solid_shapes(site, robot_height_m), dtype=object)
        inside = shapely.contains_xy(rooms.buffer(1e-6), self.x_m, self.y_m)
        made_of = (shapely.geos_version, shapely.to_wkb(self._solids).tolist(), self.x_m, self.y_m)
        clearance_m = kept_array(
            "clearance", key_of(code_key(__file__), *made_of), np.float64, self.x_m.shape, self._clearance_of_all
        )
        self.clearance_m: FloatGrid = np.where(inside, clearance_m, 0.0)
        """(rows, columns): distance from each grid point to the nearest solid thing; 0 inside it or outside rooms."""
        self.cells: BoolGrid = self.clearance_m >= robot_radius_m
        """(rows, columns): whether the robot's centre can be there."""
        self._goal_fields: dict[tuple[str, ProtocolParameters], FloatGrid] = {}

    def points(self, where: Any) -> npt.NDArray[np.object_]:
        """Return grid points as shapely points; `where` is an index of the grid."""
        return np.asarray(shapely.points(self.x_m[where], self.y_m[where]), dtype=object)

    def window_around(self, shape: BaseGeometry, within_m: float) -> tuple[slice, slice]:
        """Return the part of the grid in which every point lies that is nearer than `within_m` to a shape."""
        x_min, y_min, x_max, y_max = shape.bounds
        low, left = self.cell_of(x_min - within_m, y_min - within_m)
        high, right = self.cell_of(x_max + within_m, y_max + within_m)
        return slice(max(low - 1, 0), high + 2), slice(max(left - 1, 0), right + 2)

    def clearance_at_m(self, x_m: float, y_m: float) -> float:
        """Return the exact distance from a point to the nearest solid thing; 0 inside one or outside all rooms."""
        point = shapely.Point(x_m, y_m)
        if not any(room.shape.covers(point) for room in self.site.rooms):
            return 0.0
        return float(np.min(shapely.distance(self._solids, point)))

    def success_level_m(self, goal: str, parameters: ProtocolParameters) -> FloatGrid:
        """Return (rows, columns): negative where STOP succeeds at a goal, positive elsewhere; metres to the edge of it.

        Where no wall is near, it is the distance to the nearest footprint less the success distance, as far as four
        cells away.
        """
        within_m = parameters.success_distance_m
        level = np.full(self.cells.shape, _BAND_M)
        for thing, region in success_regions(self.site, goal, parameters):
            window = self.window_around(thing.shape, within_m + _BAND_M)
            points = self.points(window)
            straight = shapely.distance(thing.shape, points) - within_m
            near = straight < RESOLUTION_M
            near[near] = ~shapely.contains_xy(region, self.x_m[window][near], self.y_m[window][near])
            around_walls = shapely.distance(region, points[near])
            hidden = around_walls > np.maximum(straight[near], 0.0) + _OUTLINE_M
            straight[near] = np.where(hidden, around_walls, straight[near])
            level[window] = np.minimum(level[window], straight)
        return level

    def geodesic_field_m(self, goal: str, parameters: ProtocolParameters) -> FloatGrid:
        """Return (rows, columns): length of the shortest way to where STOP succeeds at a goal; inf if none."""
        key = (goal, parameters)
        if key not in self._goal_fields:
            code = code_key(__file__, judge.__file__, sight.__file__, walls.__file__)
            made_of = (version("scikit-fmm"), shapely.geos_version, self.site.sha256, self.cells, goal, parameters)
            self._goal_fields[key] = kept_array(
                "ways",
                key_of(code, *made_of),
                np.float64,
                self.cells.shape,
                lambda: distance_field_m(self.cells, self.success_level_m(goal, parameters)),
            )
        return self._goal_fields[key]

    def geodesic_to_goal_m(self, start: Pose, goal: str, parameters: ProtocolParameters = _PAPER) -> float:
        """Return the length of the shortest way from `start` to success at `goal`, metres.

        0 where the start already is near enough; inf when the goal is missing, cannot be reached, or the robot
        cannot stand at the start.
        """
        return self._interpolate(self.geodesic_field_m(goal, parameters), start)

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return (row, column) of the grid point nearest to a position, clipped to the grid."""
        rows, columns = self.cells.shape
        row = round((y_m - self.origin_y_m) / RESOLUTION_M)
        column = round((x_m - self.origin_x_m) / RESOLUTION_M)
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)

    def _clearance_of_all(self) -> FloatGrid:
        """Return (rows, columns): distance from each grid point to the nearest solid thing, worked out tile by tile.

        What is nearest to any point of a tile is no farther from the tile's middle than the nearest thing there plus
        the tile's diagonal: a few things of all.
        """
        rows, columns = self.x_m.shape
        clearance = np.empty((rows, columns))
        for low in range(0, rows, _TILE):
            for left in range(0, columns, _TILE):
                tile = (slice(low, low + _TILE), slice(left, left + _TILE))
                x_m, y_m = self.x_m[tile], self.y_m[tile]
                middle = shapely.Point((x_m[0, 0] + x_m[-1, -1]) / 2, (y_m[0, 0] + y_m[-1, -1]) / 2)
                diagonal_m = math.hypot(x_m[-1, -1] - x_m[0, 0], y_m[-1, -1] - y_m[0, 0])
                from_middle = shapely.distance(self._solids, middle)
                near = self._solids[from_middle <= from_middle.min() + diagonal_m + 1e-6]
                points = self.points(tile)
                clearance[tile] = np.min([shapely.distance(solid, points) for solid in near], axis=0)
        return clearance

    def _interpolate(self, field: FloatGrid, start: Pose) -> float:
        rows, columns = field.shape
        across = (start.x_m - self.origin_x_m) / RESOLUTION_M
        up = (start.y_m - self.origin_y_m) / RESOLUTION_M
        if not (-0.5 <= across <= columns - 0.5 and -0.5 <= up <= rows - 0.5):
            return math.inf
        row, column = min(max(int(up), 0), rows - 2), min(max(int(across), 0), columns - 2)
        corners = field[row : row + 2, column : column + 2]
        if np.isfinite(corners).all():
            v, u = min(max(up - row, 0.0), 1.0), min(max(across - column, 0.0), 1.0)
            return float(np.array([1 - v, v]) @ corners @ np.array([1 - u, u]))
        top, left = max(row - _REACH_CELLS, 0), max(column - _REACH_CELLS, 0)
        near = field[top : row + _REACH_CELLS + 1, left : column + _REACH_CELLS + 1]
        at_rows, at_columns = np.indices(near.shape)
        way_there = RESOLUTION_M * np.hypot(at_rows + top - up, at_columns + left - across)
        within_reach = way_there <= RESOLUTION_M * _REACH_CELLS
        return float(np.min(np.where(within_reach, near + way_there, np.inf)))


def distance_field_m(free: BoolGrid, level: FloatGrid) -> FloatGrid:
    """Return the length of the shortest way inside `free` to where `level` is at most 0, by fast marching.

    Args:
        free: (rows, columns) cells that a way may use, RESOLUTION_M apart.
        level: (rows, columns) a smooth function, negative in the region to reach.

    Returns:
        (rows, columns) metres; 0 inside the region, inf where it cannot be reached or the cell is not free.
    """
    import skfmm

    inside = free & (level <= 0.0)
    outside = free & ~inside
    meets = (inside[1:] & outside[:-1]) | (outside[1:] & inside[:-1])
    beside = (inside[:, 1:] & outside[:, :-1]) | (outside[:, 1:] & inside[:, :-1])
    if not meets.any() and not beside.any():  # the region is all of its rooms, or none: no front to march from
        return np.where(inside, 0.0, np.inf)
    ways = skfmm.distance(np.ma.MaskedArray(level, mask=~free), dx=RESOLUTION_M, order=2)
    field = np.ma.filled(ways, np.inf).astype(np.float64)
    field[inside] = 0.0
    field[~free] = np.inf
    return np.maximum(field, 0.0)


_KEPT: dict[tuple[str, float, float], FreeSpace] = {}
_KEEP = 8


def free_space(site: Site, robot_radius_m: float, robot_height_m: float = TOUCH_HEIGHT_M) -> FreeSpace:
    """Return the free space of a site for a round robot; the last few are kept, by the site's content."""
    key = (site.sha256, robot_radius_m, robot_height_m)
    if key not in _KEPT:
        while len(_KEPT) >= _KEEP:
            del _KEPT[next(iter(_KEPT))]
        _KEPT[key] = FreeSpace(site, robot_radius_m, robot_height_m)
    return _KEPT[key]
