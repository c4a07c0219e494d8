"""The depth guard: is there an obstacle straight ahead? (paper, Section 3.2.2)."""

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
    rays = camera.rays(width, height)
    rows, columns = rays.pixels_nearer(depth_m, base.radius_m + guard.distance_m)
    ahead, left, up = rays.points(depth_m[rows, columns], rows, columns)
    inside = np.abs(left) <= base.radius_m + guard.margin_m
    inside &= (up >= guard.min_height_m) & (up <= guard.max_height_m)
    pixels = int(np.count_nonzero(inside))
    if pixels == 0:
        return GuardReading(blocked=False)
    return GuardReading(pixels >= guard.min_pixels, pixels, float(ahead[inside].min() - base.radius_m))
