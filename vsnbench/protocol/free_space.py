"""Free space of a round robot in a site, and shortest paths from there to a goal, for SPL."""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from vsnbench.files.disk_cache import cached_array, code_key, key_of
from vsnbench.protocol import judge
from vsnbench.protocol.judge import success_regions
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites import targets
from vsnbench.sites.geometry import line_of_sight, walls
from vsnbench.sites.geometry.walls import solid_shapes
from vsnbench.sites.site import Site
from vsnbench.sites.targets import definition_sha256
from vsnbench.values.pose import Pose

RESOLUTION_M = 0.025
"""Side of a grid cell."""
_REACH_CELLS = 4
"""Maximum distance, in cells, of a start from the free space; surveys are not exact to a centimetre."""

_PAPER = ProtocolParameters()

_TILE = 16
"""Side of a tile, cells."""
_BAND_M = 4 * RESOLUTION_M
"""Limit of the distances in the level function; beyond it only the sign matters."""
_PAIR = np.arange(2)
_OUTLINE_M = 1e-3
"""Tolerance of the polygons that approximate regions."""

FloatGrid = npt.NDArray[np.float64]
BoolGrid = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int_]


class FreeSpace:
    """Grid of the positions that the centre of a round robot can have.

    `cells[row, column]` is the point (origin_x_m + column * RESOLUTION_M, origin_y_m + row * RESOLUTION_M). Use
    `free_space`, which caches instances.
    """

    def __init__(self, site: Site, robot_radius_m: float) -> None:
        """Compute the grid of a site: about a quarter of a second, then cached on disk."""
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
        self._solids = np.asarray(solid_shapes(site), dtype=object)
        inside = shapely.contains_xy(rooms.buffer(1e-6), self.x_m, self.y_m)
        made_of = (shapely.geos_version, shapely.to_wkb(self._solids).tolist(), self.x_m, self.y_m)
        clearance_m = cached_array(
            "clearance", key_of(code_key(__file__), *made_of), np.float64, self.x_m.shape, self._clearance_of_all
        )
        self.clearance_m: FloatGrid = np.where(inside, clearance_m, 0.0)
        """(rows, columns) distance from each grid point to the nearest solid; 0 inside it or outside the rooms."""
        self.cells: BoolGrid = self.clearance_m >= robot_radius_m
        """(rows, columns) whether the robot's centre can be at each grid point."""
        self._goal_fields: dict[tuple[str, ProtocolParameters], FloatGrid] = {}

    def points(self, where: Any) -> npt.NDArray[np.object_]:
        """Return grid points as shapely points; `where` is an index of the grid."""
        return np.asarray(shapely.points(self.x_m[where], self.y_m[where]), dtype=object)

    def window_around(self, shape: BaseGeometry, within_m: float) -> tuple[slice, slice]:
        """Return the part of the grid that contains all points nearer than `within_m` to a shape."""
        x_min, y_min, x_max, y_max = shape.bounds
        low, left = self.cell_of(x_min - within_m, y_min - within_m)
        high, right = self.cell_of(x_max + within_m, y_max + within_m)
        return slice(max(low - 1, 0), high + 2), slice(max(left - 1, 0), right + 2)

    def clearance_at_m(self, x_m: float, y_m: float) -> float:
        """Return the exact distance from a point to the nearest solid; 0 inside it or outside the rooms."""
        point = shapely.Point(x_m, y_m)
        if not any(room.shape.covers(point) for room in self.site.rooms):
            return 0.0
        return float(np.min(shapely.distance(self._solids, point)))

    def free_ahead_m(self, pose: Pose) -> float:
        """Return the distance to the first wall or object ahead, to within a cell; infinity beyond 1 m."""
        for distance_m in np.arange(0.0, 1.0, RESOLUTION_M):
            ahead = pose.compose(Pose(float(distance_m), 0.0))
            if self.clearance_at_m(ahead.x_m, ahead.y_m) < RESOLUTION_M:
                return float(distance_m)
        return math.inf

    def success_level_m(self, goal: str, parameters: ProtocolParameters) -> FloatGrid:
        """Return (rows, columns) signed distances from the edge of the success region, negative inside, metres.

        Without walls nearby this is the distance to the nearest footprint minus the success distance, limited to four
        cells.
        """
        level = np.full(self.cells.shape, _BAND_M)
        for window, of_target in self._levels(goal, parameters):
            level[window] = np.minimum(level[window], of_target)
        return level

    def _levels(self, goal: str, parameters: ProtocolParameters) -> Iterator[tuple[tuple[slice, slice], FloatGrid]]:
        """Yield the signed distances of each target, in its part of the grid."""
        within_m = parameters.success_distance_m
        for target, region in success_regions(self.site, goal, parameters):
            window = self.window_around(target.shape, within_m + _BAND_M)
            points = self.points(window)
            if target.is_region:
                inside = shapely.contains_xy(region, self.x_m[window], self.y_m[window])
                edge_m = np.minimum(shapely.distance(region.boundary, points), _BAND_M)
                yield window, np.where(inside, -edge_m, edge_m)
                continue
            straight = shapely.distance(target.shape, points) - within_m
            near = straight < RESOLUTION_M
            near[near] = ~shapely.contains_xy(region, self.x_m[window][near], self.y_m[window][near])
            around_walls = shapely.distance(region, points[near])
            hidden = around_walls > np.maximum(straight[near], 0.0) + _OUTLINE_M
            straight[near] = np.where(hidden, around_walls, straight[near])
            yield window, straight

    def without_path(self, starts: Sequence[Pose], goal: str, parameters: ProtocolParameters) -> list[Pose]:
        """Return the starts whose `geodesic_to_goal_m` is infinite, at a fraction of the cost of the lengths."""
        parts_of = {start: self._parts_near(start) for start in starts}
        reached: set[int] = set()
        for target in targets.targets_of(self.site, goal):  # a region of `_levels` takes 50 ms
            reached |= self._parts_at(target.shape, goal, parameters, set().union(*parts_of.values()) - reached)
        lost = {start: parts for start, parts in parts_of.items() if not parts & reached}
        for window, level in self._levels(goal, parameters) if lost else ():
            reached = set(self._parts[window][level <= 0.0].tolist())
            lost = {start: parts for start, parts in lost.items() if not parts & reached}
        return list(lost)

    def _parts_at(self, shape: BaseGeometry, goal: str, parameters: ProtocolParameters, wanted: set[int]) -> set[int]:
        """Return wanted parts in which STOP succeeds at their cell nearest to a target, of every fourth cell."""
        rows, columns = self.window_around(shape, parameters.success_distance_m)
        every_fourth = slice(rows.start, rows.stop, 4), slice(columns.start, columns.stop, 4)
        parts, x_m, y_m = self._parts[every_fourth], self.x_m[every_fourth], self.y_m[every_fourth]
        found = set()
        for part in wanted:
            here = parts == part
            if here.any():
                nearest = int(np.argmin(shapely.distance(shape, shapely.points(x_m[here], y_m[here]))))
                at = Pose(float(x_m[here][nearest]), float(y_m[here][nearest]))
                if judge.stop_succeeds(self.site, goal, at, parameters):
                    found.add(part)
        return found

    @cached_property
    def _parts(self) -> npt.NDArray[np.int32]:
        """(rows, columns) number of the connected part of the free cells that a cell belongs to; 0 for none."""
        from scipy import ndimage

        labels, _ = ndimage.label(self.cells)
        return np.asarray(labels, np.int32)

    def _parts_near(self, start: Pose) -> set[int]:
        """Return the connected parts within reach of a start."""
        rows, columns = self.cells.shape
        across, up = (start.x_m - self.origin_x_m) / RESOLUTION_M, (start.y_m - self.origin_y_m) / RESOLUTION_M
        if not (-0.5 <= across <= columns - 0.5 and -0.5 <= up <= rows - 0.5):
            return set()
        row, column = min(max(int(up), 0), rows - 2), min(max(int(across), 0), columns - 2)
        top, left = max(row - _REACH_CELLS, 0), max(column - _REACH_CELLS, 0)
        near = self._parts[top : row + _REACH_CELLS + 1, left : column + _REACH_CELLS + 1]
        at_rows, at_columns = np.indices(near.shape)
        way_there = RESOLUTION_M * np.hypot(at_rows + top - up, at_columns + left - across)
        return set(near[way_there <= RESOLUTION_M * _REACH_CELLS].tolist()) - {0}

    def geodesic_field_m(self, goal: str, parameters: ProtocolParameters) -> FloatGrid:
        """Return (rows, columns) lengths of the shortest paths to the success region of a goal; inf if none."""
        key = (goal, parameters)
        if key not in self._goal_fields:
            rules = [str(module.__file__) for module in (judge, targets, line_of_sight, walls)]
            code = code_key(__file__, *rules, str(Path(__file__).with_name("fast_marching.py")))
            definition = definition_sha256(self.site, goal)
            site = (self.site.sha256, self.cells, goal, *((definition,) if definition else ()))
            made_of = (shapely.geos_version, *site, parameters)
            self._goal_fields[key] = cached_array(
                "ways",
                key_of(code, *made_of),
                np.float64,
                self.cells.shape,
                lambda: distance_field_m(self.cells, self.success_level_m(goal, parameters)),
            )
        return self._goal_fields[key]

    def geodesic_to_goal_m(self, start: Pose, goal: str, parameters: ProtocolParameters = _PAPER) -> float:
        """Return the length of the shortest path from `start` to the success region of `goal`, metres.

        0 if the start is in this region; inf if the goal is missing or unreachable, or if the robot does not fit at
        the start.
        """
        return self._interpolate(self.geodesic_field_m(goal, parameters), start)

    def geodesics_to_goal_m(
        self, places: npt.NDArray[np.float64], goal: str, parameters: ProtocolParameters
    ) -> npt.NDArray[np.float64]:
        """Return `geodesic_to_goal_m` of many positions at once.

        Args:
            places: (n, 2) positions in the site, metres.
            goal: name of the goal.
            parameters: rules of the trial.
        """
        field = self.geodesic_field_m(goal, parameters)
        rows, columns = field.shape
        across, up = (places - (self.origin_x_m, self.origin_y_m)).T / RESOLUTION_M
        inside = (across >= -0.5) & (across <= columns - 0.5) & (up >= -0.5) & (up <= rows - 0.5)
        found = np.full(len(places), np.inf)
        across, up = across[inside], up[inside]
        row, column = np.clip(up.astype(int), 0, rows - 2), np.clip(across.astype(int), 0, columns - 2)
        corners = field[row[:, None, None] + _PAIR[:, None], column[:, None, None] + _PAIR]
        v, u = np.clip(up - row, 0.0, 1.0), np.clip(across - column, 0.0, 1.0)
        free = np.isfinite(corners).all(axis=(1, 2))
        weighted = np.stack([1 - v, v], axis=1)[:, None, :] @ np.where(free[:, None, None], corners, 0.0)
        value = (weighted @ np.stack([1 - u, u], axis=1)[:, :, None])[:, 0, 0]
        if not free.all():
            value[~free] = self._near_free(field, row[~free], column[~free], up[~free], across[~free])
        found[inside] = value
        return found

    def _near_free(
        self, field: FloatGrid, row: Integers, column: Integers, up: FloatGrid, across: FloatGrid
    ) -> FloatGrid:
        """Return the shortest ways from cells next to solids: to a free cell within reach, and from there."""
        rows, columns = field.shape
        around = np.arange(-_REACH_CELLS, _REACH_CELLS + 1)
        at_row, at_column = row[:, None] + around, column[:, None] + around
        exists = ((at_row >= 0) & (at_row < rows))[:, :, None] & ((at_column >= 0) & (at_column < columns))[:, None, :]
        near = field[at_row.clip(0, rows - 1)[:, :, None], at_column.clip(0, columns - 1)[:, None, :]]
        way_there = RESOLUTION_M * np.hypot((at_row - up[:, None])[:, :, None], (at_column - across[:, None])[:, None])
        within_reach = exists & (way_there <= RESOLUTION_M * _REACH_CELLS)
        return np.asarray(np.where(within_reach, near + way_there, np.inf).min(axis=(1, 2)), np.float64)

    def remaining_m(self, end: Pose, goal: str, parameters: ProtocolParameters) -> float:
        """Return `geodesic_to_goal_m` of the end of an episode, where the base may touch or overlap a solid.

        Where the robot does not fit, the way to the nearest free point within its radius and 10 cm is added. Without
        that, a third of a percent of the episodes (collisions) would have no progress.
        """
        field = self.geodesic_field_m(goal, parameters)
        remaining_m = self._interpolate(field, end)
        if math.isfinite(remaining_m):
            return remaining_m
        cells = _REACH_CELLS + math.ceil(self.robot_radius_m / RESOLUTION_M)
        return self._interpolate(field, end, cells)

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return (row, column) of the grid point nearest to a position, clipped to the grid."""
        rows, columns = self.cells.shape
        row = round((y_m - self.origin_y_m) / RESOLUTION_M)
        column = round((x_m - self.origin_x_m) / RESOLUTION_M)
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)

    def _clearance_of_all(self) -> FloatGrid:
        """Return (rows, columns) distances from each grid point to the nearest solid, computed tile by tile.

        The nearest solid of any point in a tile is at most the tile's diagonal farther from the tile's centre than the
        solid nearest to the centre, so that few solids must be compared.
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

    def _interpolate(self, field: FloatGrid, start: Pose, reach_cells: int = _REACH_CELLS) -> float:
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
        top, left = max(row - reach_cells, 0), max(column - reach_cells, 0)
        near = field[top : row + reach_cells + 1, left : column + reach_cells + 1]
        at_rows, at_columns = np.indices(near.shape)
        way_there = RESOLUTION_M * np.hypot(at_rows + top - up, at_columns + left - across)
        within_reach = way_there <= RESOLUTION_M * reach_cells
        return float(np.min(np.where(within_reach, near + way_there, np.inf)))


def distance_field_m(free: BoolGrid, level: FloatGrid) -> FloatGrid:
    """Return the lengths of the shortest paths inside `free` to the region where `level` <= 0, by fast marching.

    Args:
        free: (rows, columns) cells that a path may use, RESOLUTION_M apart.
        level: (rows, columns) smooth function, negative inside the region.

    Returns:
        (rows, columns) metres; 0 inside the region, inf for unreachable cells and cells that are not free.
    """
    inside = free & (level <= 0.0)
    outside = free & ~inside
    vertical = (inside[1:] & outside[:-1]) | (outside[1:] & inside[:-1])
    horizontal = (inside[:, 1:] & outside[:, :-1]) | (outside[:, 1:] & inside[:, :-1])
    if not vertical.any() and not horizontal.any():  # no front to march from: the region is all of its rooms, or empty
        return np.where(inside, 0.0, np.inf)
    from vsnbench.protocol.fast_marching import signed_distance_m

    field: FloatGrid = signed_distance_m(level, free, RESOLUTION_M)
    field[inside] = 0.0
    field[~free] = np.inf
    return np.maximum(field, 0.0)


_CACHE: dict[tuple[str, str, float], FreeSpace] = {}
_CACHE_SIZE = 8


def free_space(site: Site, robot_radius_m: float) -> FreeSpace:
    """Return the free space of a site for a round robot, cached by the site's content and goals."""
    key = (site.sha256, site.goals_sha256, robot_radius_m)
    if key not in _CACHE:
        while len(_CACHE) >= _CACHE_SIZE:
            del _CACHE[next(iter(_CACHE))]
        _CACHE[key] = FreeSpace(site, robot_radius_m)
    return _CACHE[key]
