"""Rooms of endless upright walls, and what a depth camera sees in them."""

import math

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose

CAMERA = Camera(width=160, height=120, horizontal_fov_deg=60, mount_height_m=0.6, mount_forward_m=-0.087)
Wall = tuple[tuple[float, float], tuple[float, float]]


def box(left: float, low: float, right: float, high: float) -> list[Wall]:
    corners = [(left, low), (right, low), (right, high), (left, high)]
    return list(zip(corners, [*corners[1:], corners[0]], strict=True))


def depth_of(walls: list[Wall], pose: Pose, camera: Camera = CAMERA) -> npt.NDArray[np.float32]:
    """Return (H, W) the depth of walls, metres; NaN where there is none."""
    rays = camera.rays(camera.width, camera.height)
    ahead, left = np.broadcast_arrays(rays.ahead[:, None], rays.left[None, :])
    lens = pose.compose(Pose(camera.mount_forward_m, 0.0))
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    way = np.stack((cos * ahead - sin * left, sin * ahead + cos * left))
    nearest = np.full(ahead.shape, np.inf)
    for start, end in walls:
        along = np.array(end) - start
        normal = np.array([-along[1], along[0]])
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (normal @ (np.array(start) - lens.position)) / np.tensordot(normal, way, 1)
        share = np.tensordot(along, way * depth, 1) + along @ (np.array(lens.position) - start)
        hit = (depth > 0) & (share >= 0) & (share <= along @ along)
        nearest = np.where(hit, np.minimum(nearest, depth), nearest)
    return np.where(np.isfinite(nearest), nearest, np.nan).astype(np.float32)
