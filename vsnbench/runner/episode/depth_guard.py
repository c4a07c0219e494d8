"""The depth guard: refuses forward moves into an obstacle or an unseen path (paper, Section 3.2.2)."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from vsnbench.protocol.depth_evidence import Evidence, evidence_pixels
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation, observation_of
from vsnbench.values.robot_profile import Base


class Refusal(StrEnum):
    """Why the guard refuses a movement."""

    OBSTACLE = "obstacle"
    """Depth pixels lie in the robot's path."""
    TOO_NEAR = "too near"
    """Part of the path has no depth: an obstacle nearer than the camera's minimum range is possible."""
    BLIND = "blind"
    """Hardly any pixel that must show the path has depth."""
    UNSEEN = "unseen"
    """Part of a way to the side was never seen."""


@dataclass(frozen=True, slots=True)
class GuardReading:
    """Result of the guard in the robot's swath."""

    refusal: Refusal | None = None
    """None if the robot may move."""
    pixels: int = 0
    """Valid depth pixels in the swath nearer than the guard's distance; to the side, cells of the remembered map."""
    nearest_m: float | None = None
    """The nearest of them, metres ahead of the robot's front, or from its shell to the side."""
    valid_share: float = 1.0
    """Share of the pixels that must show the path and have depth; to the side, share of the way that was seen."""
    side: str = ""
    """`left` or `right` for a sidestep; empty for a forward move."""

    @property
    def blocked(self) -> bool:
        """Whether the move is refused."""
        return self.refusal is not None

    @property
    def text(self) -> str:
        """The reading as text for the record and the display."""
        if self.refusal is Refusal.BLIND:
            return f"blind: {self.valid_share:.0%} of the pixels that must show the path ahead have depth"
        if self.refusal is Refusal.TOO_NEAR:
            return "part of the path ahead has no depth: an obstacle nearer than the camera's range, or no echo"
        if self.refusal is Refusal.UNSEEN:
            return f"the camera has seen {self.valid_share:.0%} of the way to the {self.side}: turn to look there first"
        if self.side and self.nearest_m is not None:
            return f"obstacle {max(self.nearest_m, 0):.2f} m to the {self.side}, as seen before"
        if self.nearest_m is None:
            return "nothing ahead"
        return f"obstacle {max(self.nearest_m, 0):.2f} m ahead of the front ({self.pixels} depth pixels)"


def get_ready(camera: Camera, base: Base, guard: DepthGuard) -> None:
    """Compile the loops before a robot waits for its first move."""
    look_ahead(observation_of(0.0, camera, depth_m=np.full((1, 1), np.nan, np.float32)), base, guard)
    size = (camera.height, camera.width)
    look_ahead(observation_of(0.0, camera, depth_m=np.full(size, np.nan, np.float32)), base, guard)


def look_ahead(observation: Observation, base: Base, guard: DepthGuard) -> GuardReading:
    """Return whether a forward move must be refused; never for a robot without depth images.

    An obstacle consists of pixels whose points lie within the robot's radius plus margin to both sides, between the
    guard's heights, and nearer than its distance ahead of the front. Without an obstacle, the path must be visibly
    free, see `vsnbench.protocol.depth_evidence`.
    """
    from vsnbench.values.encoding.depth_kernels import pixels_in_swath

    depth_m, camera = observation.depth_m, observation.camera
    if depth_m is None or not guard.enabled:
        return GuardReading()
    height, width = depth_m.shape
    rays = camera.rays(width, height)
    if not (looks_ahead := rays.ahead > 0).all():  # rows of a camera that looks down show what is behind its lens
        depth_m, rays = depth_m[looks_ahead], replace(rays, ahead=rays.ahead[looks_ahead], up=rays.up[looks_ahead])
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
    evidence = evidence_in(observation, base, guard)
    refusal = None
    if pixels >= guard.min_pixels:
        refusal = Refusal.OBSTACLE
    elif evidence.is_blind:
        refusal = Refusal.BLIND
    elif evidence.hides_something:
        refusal = Refusal.TOO_NEAR
    return GuardReading(refusal, pixels, nearest_m - base.radius_m if pixels else None, evidence.valid_share)


def evidence_in(observation: Observation, base: Base, guard: DepthGuard) -> Evidence:
    """Return the depth where the path ahead must be visible; the observation must have a depth image."""
    depth_m, camera = observation.depth_m, observation.camera
    assert depth_m is not None  # noqa: S101  # checked by the caller
    where = evidence_pixels(camera, depth_m.shape[1], depth_m.shape[0], base.radius_m, guard)
    return where.read(np.ascontiguousarray(depth_m), camera)
