"""A pixel of the camera image as a waypoint, through the depth image."""

import math

import numpy as np

from vsnbench.protocol.parameters import DepthGuard
from vsnbench.values.movement import MAX_DISTANCE_M, Pixel, Waypoint
from vsnbench.values.observation import Observation
from vsnbench.values.robot_profile import Base

_HALF_WINDOW = 2
"""Pixels to each side whose median depth counts."""


def waypoint_of(pixel: Pixel, observation: Observation, base: Base, guard: DepthGuard) -> Waypoint | None:
    """Return the point of the floor plan that a pixel shows, or None if its depth is not known.

    In front of an object, the waypoint leaves the guard's distance to it; a farther point than a waypoint may be is
    shortened to that.
    """
    depth_m = observation.depth_m
    if depth_m is None:
        return None
    row, column = round(pixel.v), round(pixel.u)
    if not (0 <= row < depth_m.shape[0] and 0 <= column < depth_m.shape[1]):
        return None
    rows = slice(max(row - _HALF_WINDOW, 0), row + _HALF_WINDOW + 1)
    columns = slice(max(column - _HALF_WINDOW, 0), column + _HALF_WINDOW + 1)
    window = depth_m[rows, columns]
    known = window[np.isfinite(window) & (window > 0)]
    if known.size == 0:
        return None
    rays = observation.camera.rays(depth_m.shape[1], depth_m.shape[0])
    ahead, left, up = rays.points(np.median(known, keepdims=True), np.array([row]), np.array([column]))
    x_m, y_m, height_m = float(ahead[0]), float(left[0]), float(up[0])
    distance_m = math.hypot(x_m, y_m)
    reach_m = min(distance_m, MAX_DISTANCE_M)
    if height_m > guard.min_height_m:
        reach_m = min(reach_m, max(distance_m - base.radius_m - guard.distance_m, 0.0))
    if distance_m == 0.0:
        return Waypoint(0.0, 0.0)
    return Waypoint(x_m * reach_m / distance_m, y_m * reach_m / distance_m)
