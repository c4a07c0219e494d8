"""The pinhole camera of a robot and where it sits on it."""

import math
from typing import Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field


class Camera(BaseModel):
    """A pinhole camera, its mount on the base, and the range of its depth sensor.

    The optical axis lies in the robot's vertical plane x-z; pixels are square and the principal point is central.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    width: int = Field(gt=0, le=4096, description="image width, pixels")
    height: int = Field(gt=0, le=4096, description="image height, pixels")
    horizontal_fov_deg: float = Field(gt=10, lt=170, description="horizontal field of view, degrees")
    mount_height_m: float = Field(gt=0, lt=3, description="optical centre above the floor, metres")
    mount_forward_m: float = Field(default=0.0, description="optical centre ahead of the base's axis, metres")
    tilt_deg: float = Field(default=0.0, gt=-60, lt=60, description="degrees; positive looks up")
    depth_min_m: float = Field(default=0.0, ge=0, description="nearer depth is invalid, metres")
    depth_max_m: float = Field(default=10.0, gt=0, description="farther depth is invalid, metres")

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, the same on both axes."""
        return self.width / 2 / math.tan(math.radians(self.horizontal_fov_deg) / 2)

    @property
    def center_px(self) -> tuple[float, float]:
        """Principal point (cx, cy) in pixels; pixel (0, 0) has its centre at (0, 0)."""
        return ((self.width - 1) / 2, (self.height - 1) / 2)

    def resized(self, width: int, height: int) -> Self:
        """Return the same view at another resolution."""
        return self.model_copy(update={"width": width, "height": height})

    def points_in_base(self, depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Back-project a depth image (H, W), metres along the optical axis, into the base frame.

        Returns:
            (H, W, 3) float32 points x forward, y left, z up from the floor under the base's axis; NaN where the
            depth is invalid.
        """
        height, width = depth_m.shape
        cx, cy = self.center_px
        right = (np.arange(width, dtype=np.float32) - np.float32(cx)) / np.float32(self.focal_px)
        down = (np.arange(height, dtype=np.float32) - np.float32(cy)) / np.float32(self.focal_px)
        tilt = math.radians(self.tilt_deg)
        cos, sin = np.float32(math.cos(tilt)), np.float32(math.sin(tilt))
        points = np.empty((height, width, 3), np.float32)
        points[..., 0] = depth_m * (cos + sin * down)[:, None] + np.float32(self.mount_forward_m)
        points[..., 1] = depth_m * -right[None, :]
        points[..., 2] = depth_m * (sin - cos * down)[:, None] + np.float32(self.mount_height_m)
        return points
