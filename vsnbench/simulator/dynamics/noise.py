"""Noise of simulated sensors: odometry with drift, depth images with noise and holes.

Noise is off by default. It depends only on a seed and is added to the effects of wheel slip.
"""

import math

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from vsnbench.values.pose import Pose, advanced


class OdometryNoise(BaseModel):
    """Calibration errors, drawn once per episode, and a random walk of the heading along the path."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    way_scale_std: float = Field(default=0.01, ge=0, le=0.5, description="relative error of every distance")
    turn_scale_std: float = Field(default=0.01, ge=0, le=0.5, description="relative error of every turn")
    wander_rad_per_sqrt_m: float = Field(default=0.01, ge=0, le=1, description="random walk of the heading")


class DepthNoise(BaseModel):
    """Noise of a structured-light camera: an error that grows with the square of the distance, and lost pixels."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    near_std_m: float = Field(default=0.0015, ge=0, le=0.5, description="standard deviation at zero distance")
    square_std_per_m: float = Field(default=0.0020, ge=0, le=0.5, description="added per square metre of distance")
    edge_jump_share: float = Field(default=0.06, gt=0, le=1, description="a larger relative jump is an edge")
    edge_loss: float = Field(default=0.6, ge=0, le=1, description="share of the pixels at edges that are lost")
    dark_luminance: float = Field(default=0.12, ge=0, le=1, description="darker surfaces reflect too little light")
    dark_loss: float = Field(default=0.5, ge=0, le=1, description="share of the pixels on dark surfaces that are lost")
    shiny_loss: float = Field(default=0.6, ge=0, le=1, description="share lost on a surface like a mirror")


class NoiseSettings(BaseModel):
    """Noise of all sensors."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    odometry: OdometryNoise = Field(default_factory=OdometryNoise)
    depth: DepthNoise = Field(default_factory=DepthNoise)


class OdometryDrift:
    """Adds calibration errors to exact odometry; one instance per episode."""

    def __init__(self, noise: OdometryNoise, rng: np.random.Generator) -> None:
        self._noise = noise
        self._rng = rng
        self._way_scale = 1 + noise.way_scale_std * float(rng.standard_normal())
        self._turn_scale = 1 + noise.turn_scale_std * float(rng.standard_normal())
        self._exact = Pose(0.0, 0.0, 0.0)
        self._drifted = Pose(0.0, 0.0, 0.0)

    def update(self, exact: Pose) -> Pose:
        """Return the odometry with drift for the newest exact odometry."""
        turn_rad = exact.heading_rad - self._exact.heading_rad
        middle_rad = self._exact.heading_rad + turn_rad / 2
        way_m = (exact.x_m - self._exact.x_m) * math.cos(middle_rad) + (exact.y_m - self._exact.y_m) * math.sin(
            middle_rad
        )
        wander_rad = self._noise.wander_rad_per_sqrt_m * math.sqrt(abs(way_m)) * float(self._rng.standard_normal())
        self._drifted = advanced(self._drifted, way_m * self._way_scale, turn_rad * self._turn_scale + wander_rad)
        self._exact = exact
        return self._drifted


def noisy_depth(
    depth_m: npt.NDArray[np.float32],
    rgb: npt.NDArray[np.uint8],
    shininess: npt.NDArray[np.float32],
    noise: DepthNoise,
    rng: np.random.Generator,
) -> npt.NDArray[np.float32]:
    """Return a depth image with the noise of a real camera.

    Args:
        depth_m: (H, W) true depth, metres; NaN or infinite without a surface.
        rgb: (H, W, 3) colour image.
        shininess: (H, W) shininess of the surface at each pixel, 0 matt to 1 mirror-like.
        noise: parameters of the noise.
        rng: random number generator.

    Returns:
        (H, W) float32; lost pixels are NaN.
    """
    depth_m = np.where(np.isfinite(depth_m), depth_m, np.float32(np.nan))
    spread = noise.near_std_m + noise.square_std_per_m * depth_m**2
    noisy = depth_m + rng.standard_normal(depth_m.shape, dtype=np.float32) * spread.astype(np.float32)
    luminance = rgb.astype(np.float32) @ np.array([0.2126, 0.7152, 0.0722], np.float32) / np.float32(255)
    survival = (1 - noise.edge_loss * _edges(depth_m, noise.edge_jump_share)) * (1 - noise.shiny_loss * shininess)
    survival *= 1 - noise.dark_loss * (luminance < noise.dark_luminance)
    noisy[rng.random(depth_m.shape, dtype=np.float32) >= survival] = np.nan
    return noisy


def _edges(depth_m: npt.NDArray[np.float32], jump_share: float) -> npt.NDArray[np.bool_]:
    """Return the pixels on both sides of a jump in depth; a border to missing depth is a jump."""
    far = np.where(np.isfinite(depth_m), depth_m, np.float32(1e3))
    edges = np.zeros(depth_m.shape, np.bool_)
    for near, next_to_it in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])):
        jump = np.abs(far[near] - far[next_to_it]) > jump_share * np.minimum(far[near], far[next_to_it])
        edges[near] |= jump
        edges[next_to_it] |= jump
    return edges
