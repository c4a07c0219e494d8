"""Observations for tests of policies without a simulator."""

import numpy as np

from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.6)


def look(pose: Pose | None = None, depth_m: float | None = None) -> Observation:
    """Return an observation at `pose` (frame of the start) of a wall `depth_m` ahead, or without depth."""
    depth = None if depth_m is None else np.full((CAMERA.height, CAMERA.width), depth_m, np.float32)
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    return Observation(rgb, depth, pose or Pose(0.0, 0.0), 0.0, CAMERA)
