"""Short-term goals of views: free points in the view's direction that are near the node."""

import math

import numpy as np

from vsnbench.models.vlv.planner import BoolGrid, FloatGrid, Point, Terrain
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.sensing.occupancy_map import OccupancyMap

_DRAWS = 100
_STEP_M = 0.1
_RAYS = 36
_LOOK_M = 3.0


def sub_goal_of(
    node: Point,
    heading_rad: float,
    terrain: Terrain,
    lengths_m: FloatGrid,
    settings: VLVSettings,
    random: np.random.Generator,
) -> Point | None:
    """Return a sub-goal in a direction from a node, or None if nothing there is free.

    The settings have the rule of the distance: fixed (paper, Section 3.2.1) or sampled as in the original source.
    `lengths_m` (rows, columns) are path lengths from the node.
    """
    if settings.sub_goal == "sampled":
        half_rad = math.radians(settings.sub_goal_half_angle_deg)
        draws = (
            (random.uniform(settings.sub_goal_min_m, settings.sub_goal_max_m), random.uniform(-half_rad, half_rad))
            for _ in range(_DRAWS)
        )
    else:
        nearest_m = min(settings.sub_goal_min_m, settings.sub_goal_m)
        count = int((settings.sub_goal_m - nearest_m) / _STEP_M + 1e-9) + 1
        draws = ((settings.sub_goal_m - k * _STEP_M, 0.0) for k in range(count))
    for far_m, aside_rad in draws:
        angle = heading_rad + aside_rad
        point = (node[0] + far_m * math.cos(angle), node[1] + far_m * math.sin(angle))
        cell = terrain.map.cell_at(*point)
        if (
            terrain.is_open(*point)
            and lengths_m[cell.row, cell.column] < settings.sub_goal_way_m
            and terrain.sees(node, point)
        ):
            return point
    return None


def unknown_around(point: Point, grid: OccupancyMap, known: BoolGrid, obstacles: BoolGrid) -> float:
    """Return the share of unknown cells among those visible from a point, up to 3 m."""
    angles = np.arange(_RAYS) * (2 * math.pi / _RAYS)
    far_m = np.arange(1, int(_LOOK_M / grid.resolution_m) + 1) * grid.resolution_m
    columns = np.floor((point[0] + np.outer(np.cos(angles), far_m) - grid.origin_x_m) / grid.resolution_m).astype(int)
    rows = np.floor((point[1] + np.outer(np.sin(angles), far_m) - grid.origin_y_m) / grid.resolution_m).astype(int)
    height, width = known.shape
    inside = (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
    rows, columns = rows.clip(0, height - 1), columns.clip(0, width - 1)
    hidden = np.logical_or.accumulate(obstacles[rows, columns] & inside, axis=1)
    unknown = ~(known[rows, columns] & inside)
    return float(np.count_nonzero(unknown & ~hidden) / unknown.size)
