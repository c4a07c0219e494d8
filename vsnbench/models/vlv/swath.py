"""What stands in the way of a forward move, by the depth image: the policy's own look before it asks for one."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose

Point = tuple[float, float]

_SIDE_MARGIN_M: Final = 0.02
_LOWEST_M, _HIGHEST_M = 0.04, 1.2
_FEWEST_PIXELS: Final = 40


def obstacles_ahead(
    depth_m: npt.NDArray[np.float32], camera: Camera, pose: Pose, settings: VLVSettings
) -> tuple[Point, ...]:
    """Return points of the start's frame, a few centimetres apart, that leave no room for a forward move.

    Args:
        depth_m: (H, W) metres along the optical axis, NaN where invalid.
        camera: where the camera sits.
        pose: of the base in the start's frame.
        settings: radius and free way wanted ahead.
    """
    height, width = depth_m.shape
    focal_px = camera.focal_px * width / camera.width
    tilt_rad = math.radians(camera.tilt_deg)
    down = ((np.arange(height) - (height - 1) / 2) / focal_px).astype(np.float32)
    stretch = np.float32(math.cos(tilt_rad)) + np.float32(math.sin(tilt_rad)) * down
    reach_m = settings.robot_radius_m + settings.look_ahead_m - camera.mount_forward_m
    rows, columns = np.nonzero(depth_m * stretch[:, None] < reach_m)
    depth = depth_m[rows, columns].astype(np.float64)
    left = -depth * (columns - (width - 1) / 2) / focal_px
    up = depth * (math.sin(tilt_rad) - math.cos(tilt_rad) * down[rows]) + camera.mount_height_m
    inside = (np.abs(left) <= settings.robot_radius_m + _SIDE_MARGIN_M) & (up >= _LOWEST_M) & (up <= _HIGHEST_M)
    if np.count_nonzero(inside) < _FEWEST_PIXELS:
        return ()
    ahead = depth[inside] * stretch[rows[inside]] + camera.mount_forward_m
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x_m = pose.x_m + cos * ahead - sin * left[inside]
    y_m = pose.y_m + sin * ahead + cos * left[inside]
    coarse = np.unique(np.floor(np.column_stack((x_m, y_m)) / settings.resolution_m), axis=0)
    return tuple(
        ((float(x) + 0.5) * settings.resolution_m, (float(y) + 0.5) * settings.resolution_m) for x, y in coarse
    )
