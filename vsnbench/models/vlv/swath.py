"""Obstacles to a forward move in the depth image, checked by the policy before it moves."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.planner import Point
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

_SIDE_MARGIN_M: Final = 0.02
_LOWEST_M, _HIGHEST_M = 0.04, 1.2
_MIN_PIXELS: Final = 40


def obstacles_ahead(
    depth_m: npt.NDArray[np.float32], camera: Camera, pose: Pose, settings: VLVSettings
) -> tuple[Point, ...]:
    """Return points in the start's frame, a few centimetres apart, that block a forward move from a pose.

    `depth_m` (H, W) is in metres along the optical axis, NaN where invalid.
    """
    rays = camera.rays(depth_m.shape[1], depth_m.shape[0])
    rows, columns = rays.pixels_nearer(depth_m, settings.robot_radius_m + settings.look_ahead_m)
    ahead, left, up = rays.points(depth_m[rows, columns], rows, columns)
    inside = (np.abs(left) <= settings.robot_radius_m + _SIDE_MARGIN_M) & (up >= _LOWEST_M) & (up <= _HIGHEST_M)
    if np.count_nonzero(inside) < _MIN_PIXELS:
        return ()
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x_m = pose.x_m + cos * ahead[inside] - sin * left[inside]
    y_m = pose.y_m + sin * ahead[inside] + cos * left[inside]
    coarse = np.unique(np.floor(np.column_stack((x_m, y_m)) / settings.resolution_m), axis=0)
    return tuple(
        ((float(x) + 0.5) * settings.resolution_m, (float(y) + 0.5) * settings.resolution_m) for x, y in coarse
    )
