"""The depth guard: is there an obstacle straight ahead? (paper, Section 3.2.2)."""

from dataclasses import dataclass

import numpy as np

from vsnbench.protocol.camera import Camera
from vsnbench.protocol.observation import Observation, observation_of
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


def get_ready(camera: Camera, base: Base, guard: DepthGuard) -> None:
    """Have the loop compiled now, not while a robot stands before its first move."""
    look_ahead(observation_of(0.0, camera, depth_m=np.full((1, 1), np.nan, np.float32)), base, guard)


def look_ahead(observation: Observation, base: Base, guard: DepthGuard) -> GuardReading:
    """Return whether a forward move must be refused; without a depth image nothing is ever refused.

    Only pixels whose point lies within the robot's radius plus margin to both sides, between the guard's heights,
    and nearer than its distance ahead of the front count; invalid depth (NaN) never does.
    """
    from vsnbench.protocol.depth_rows import pixels_in_swath

    depth_m, camera = observation.depth_m, observation.camera
    if depth_m is None or not guard.enabled:
        return GuardReading(blocked=False)
    height, width = depth_m.shape
    rays = camera.rays(width, height)
    pixels, nearest_m = pixels_in_swath(
        np.ascontiguousarray(depth_m),
        np.float32(base.radius_m + guard.distance_m - rays.forward_m),
        rays.ahead.astype(np.float32),
        rays.ahead,
        rays.left,
        rays.up,
        rays.forward_m,
        rays.height_m,
        base.radius_m + guard.margin_m,
        guard.min_height_m,
        guard.max_height_m,
    )
    if pixels == 0:
        return GuardReading(blocked=False)
    return GuardReading(pixels >= guard.min_pixels, pixels, nearest_m - base.radius_m)
