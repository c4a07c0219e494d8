"""The depth guard: is there an obstacle straight ahead? (paper, Section 3.2.2)."""

import math
from dataclasses import dataclass

import numpy as np

from vsnbench.protocol.observation import Observation
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.protocol.robot_profile import Base


@dataclass(frozen=True, slots=True)
class GuardReading:
    """What the guard saw in the robot's swath."""

    blocked: bool
    pixels: int = 0
    """Valid depth pixels in the swath nearer than the guard's distance."""
    nearest_m: float | None = None
    """The nearest of them, metres ahead of the robot's front."""

    @property
    def words(self) -> str:
        """The reading as a person would say it."""
        if self.nearest_m is None:
            return "nothing ahead"
        return f"obstacle {max(self.nearest_m, 0):.2f} m ahead of the front ({self.pixels} depth pixels)"


def look_ahead(observation: Observation, base: Base, guard: DepthGuard) -> GuardReading:
    """Return whether a forward move must be refused; without a depth image nothing is ever refused.

    Only pixels whose point lies within the robot's radius plus margin to both sides, between the guard's heights,
    and nearer than its distance ahead of the front count; invalid depth (NaN) never does.
    """
    depth_m, camera = observation.depth_m, observation.camera
    if depth_m is None or not guard.enabled:
        return GuardReading(blocked=False)
    height, width = depth_m.shape
    cx, cy = (width - 1) / 2, (height - 1) / 2
    focal_px = camera.focal_px * width / camera.width
    tilt = math.radians(camera.tilt_deg)
    down = (np.arange(height, dtype=np.float32) - cy) / focal_px
    ahead_per_depth = (math.cos(tilt) + math.sin(tilt) * down).astype(np.float32)
    reach_m = base.radius_m + guard.distance_m - camera.mount_forward_m
    rows, columns = np.nonzero(depth_m * ahead_per_depth[:, None] < reach_m)
    depths = depth_m[rows, columns]
    sideways = depths * (columns - cx) / focal_px
    up = depths * (math.sin(tilt) - math.cos(tilt) * down[rows]) + camera.mount_height_m
    inside = np.abs(sideways) <= base.radius_m + guard.margin_m
    inside &= (up >= guard.min_height_m) & (up <= guard.max_height_m)
    pixels = int(np.count_nonzero(inside))
    if pixels == 0:
        return GuardReading(blocked=False)
    ahead = depths[inside] * ahead_per_depth[rows[inside]] + camera.mount_forward_m - base.radius_m
    return GuardReading(pixels >= guard.min_pixels, pixels, float(ahead.min()))
