"""From a view of a node to a short-term goal: off the node in the view's direction, free, and not far to walk."""

import math

import numpy as np

from vsnbench.models.vlv.planner import FloatGrid, Point, Terrain
from vsnbench.models.vlv.settings import SubGoalRule, VLVSettings

_DRAWS = 100
_STEP_M = 0.1


def sub_goal_of(
    node: Point,
    heading_rad: float,
    terrain: Terrain,
    lengths_m: FloatGrid,
    settings: VLVSettings,
    random: np.random.Generator,
) -> Point | None:
    """Return where to go from a node in a direction; None when nothing there is free.

    Args:
        node: where the robot stands.
        heading_rad: of the view, in the start's frame.
        terrain: where the robot can be.
        lengths_m: (rows, columns) ways from the node.
        settings: the rule, fixed (paper, Section 3.2.1) or sampled as in the original source.
        random: for the sampled rule.
    """
    if settings.sub_goal is SubGoalRule.SAMPLED:
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
