"""Synthetic observations: a wall ahead, an object before it, and its category label."""

import numpy as np
import numpy.typing as npt

from vsnbench.values.camera import Camera
from vsnbench.values.observation import InstanceImage, Observation
from vsnbench.values.pose import Pose

CAMERA = Camera(width=160, height=120, horizontal_fov_deg=60, mount_height_m=0.6, depth_min_m=0.4, depth_max_m=8)


def wall_and_floor(distance_m: float) -> npt.NDArray[np.float32]:
    """Return the depth of a bare floor up to a wall."""
    down = (np.arange(120, dtype=np.float32) - 59.5) / np.float32(CAMERA.focal_px)
    with np.errstate(divide="ignore"):
        floor = np.where(down > 0, np.float32(CAMERA.mount_height_m) / down, np.inf)
    return np.repeat(np.minimum(floor, distance_m).astype(np.float32)[:, None], 160, axis=1)


def look(
    *things: tuple[str, tuple[int, int, int, int], float],
    pose: Pose | None = None,
    wall_m: float = 4.0,
    depth: bool = True,
) -> Observation:
    """Return an observation.

    Args:
        things: category, (top, bottom, left, right) in pixels, and distance in metres of each; NaN for no depth.
        pose: pose of the robot; default: the start.
        wall_m: distance of the wall.
        depth: whether the observation has a depth image.
    """
    depth_m = wall_and_floor(wall_m)
    ids = np.zeros((120, 160), np.int32)
    for number, (_, (top, bottom, left, right), distance_m) in enumerate(things, 1):
        depth_m[top:bottom, left:right] = distance_m
        ids[top:bottom, left:right] = number
    return Observation(
        rgb=np.full((120, 160, 3), 127, np.uint8),
        depth_m=depth_m if depth else None,
        pose=pose or Pose(0.0, 0.0),
        stamp_s=0.0,
        camera=CAMERA,
        instances=InstanceImage(ids, {number: thing[0] for number, thing in enumerate(things, 1)}),
    )
