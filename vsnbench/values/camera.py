"""Pinhole camera of a robot and its mount."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

from vsnbench.values.pose import LEVEL, Attitude

_LATER = ("roll_deg", "exposure_s", "mount_left_m", "yaw_deg")
"""Fields that profiles of older versions do not have."""


class CameraRole(StrEnum):
    """Which way a camera of a robot looks. `front` is the main camera, by which vsnbench drives and judges."""

    FRONT = "front"
    LEFT = "left"
    RIGHT = "right"
    REAR = "rear"


class Camera(BaseModel):
    """A pinhole camera, its mount on the base, and the range of its depth sensor.

    The optical axis of the main camera lies in the robot's vertical plane x-z; pixels are square and the principal
    point is central. Images of an observation fit this model without roll: robots rectify what their camera sends.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    width: int = Field(gt=0, le=4096, description="image width, pixels")
    height: int = Field(gt=0, le=4096, description="image height, pixels")
    horizontal_fov_deg: float = Field(gt=10, lt=170, description="horizontal field of view, degrees")
    mount_height_m: float = Field(gt=0, lt=3, description="optical centre above the floor, metres")
    mount_forward_m: float = Field(
        default=0.0, gt=-1.5, lt=1.5, description="optical centre ahead of the base's axis, metres"
    )
    mount_left_m: float = Field(
        default=0.0, gt=-1.5, lt=1.5, description="optical centre to the left of the base's axis, metres"
    )
    yaw_deg: float = Field(
        default=0.0, ge=-180, le=180, description="heading on the base, degrees; positive looks to the left"
    )
    tilt_deg: float = Field(default=0.0, ge=-90, lt=60, description="degrees; positive looks up, -90 straight down")
    roll_deg: float = Field(
        default=0.0, gt=-30, lt=30, description="degrees; positive is clockwise, seen from behind the camera"
    )
    depth_min_m: float = Field(default=0.0, ge=0, description="nearer depth is invalid, metres")
    depth_max_m: float = Field(default=10.0, gt=0, description="farther depth is invalid, metres")
    exposure_s: float = Field(
        default=0.0, ge=0, le=0.2, description="time for which simulated colours are exposed: they blur with motion"
    )

    @model_serializer(mode="wrap")
    def _without_later_zeros(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit zeros of fields that older profiles did not have, so that hashes of profiles do not change."""
        content: dict[str, Any] = handler(self)
        return {name: value for name, value in content.items() if value or name not in _LATER}

    @property
    def without_roll(self) -> Self:
        """The camera of a robot's images, whose roll is rectified."""
        return self.model_copy(update={"roll_deg": 0.0}) if self.roll_deg else self

    def axes(self, attitude: Attitude = LEVEL) -> npt.NDArray[np.float64]:
        """Return the camera's axes (3, 3) as rows right, down and forward, on a base with an attitude.

        They are in axes with the base's heading on a level floor: x forward, y left, z up.
        """
        tilt_rad, roll_rad = math.radians(self.tilt_deg), math.radians(self.roll_deg)
        level, rise = math.cos(tilt_rad), math.sin(tilt_rad)
        right, down = np.array([0.0, -1.0, 0.0]), np.array([rise, 0.0, -level])
        rolled = math.cos(roll_rad) * right + math.sin(roll_rad) * down
        axes = np.array([rolled, math.cos(roll_rad) * down - math.sin(roll_rad) * right, [level, 0.0, rise]])
        if self.yaw_deg:
            cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
            axes = axes @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(axes @ attitude.rotation.T)

    def on(self, attitude: Attitude) -> Self:
        """Return the camera without roll whose images those of this one are rectified to, on a base with an attitude.

        The body turns about the point of its axis at the height of the lens: a lens ahead of the axis sinks as the
        front does.
        """
        if attitude == LEVEL:
            return self.without_roll
        forward = self.axes(attitude)[2]
        tilt_deg = math.degrees(math.asin(max(-1.0, min(1.0, float(forward[2])))))
        if self.is_ahead:
            down_m = math.sin(attitude.pitch_rad) * self.mount_forward_m
            mount = {"mount_forward_m": math.cos(attitude.pitch_rad) * self.mount_forward_m}
        else:
            ahead_m, left_m, up_m = attitude.rotation @ [self.mount_forward_m, self.mount_left_m, 0.0]
            down_m, yaw_deg = -float(up_m), math.degrees(math.atan2(forward[1], forward[0]))
            mount = {"mount_forward_m": float(ahead_m), "mount_left_m": float(left_m), "yaw_deg": yaw_deg}
        mount["mount_height_m"] = self.mount_height_m - down_m
        return self.model_copy(update={**mount, "tilt_deg": tilt_deg, "roll_deg": 0.0})

    @property
    def is_ahead(self) -> bool:
        """Whether the optical axis lies in the robot's vertical plane x-z, as that of the main camera."""
        return not self.mount_left_m and not self.yaw_deg

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

    def cut_to(self, width: int, height: int) -> Self:
        """Return the largest central part of this view with the given shape, at this resolution."""
        focal_px = self.focal_px * max(width / self.width, height / self.height)
        fov_deg = math.degrees(2 * math.atan(width / 2 / focal_px))
        return self.model_copy(update={"width": width, "height": height, "horizontal_fov_deg": fov_deg})

    def rays(self, width: int, height: int) -> "Rays":
        """Return the rays of all pixels of this view at a resolution; for the main camera."""
        focal_px = self.focal_px * width / self.width
        tilt_rad = math.radians(self.tilt_deg)
        down = (np.arange(height, dtype=np.float64) - (height - 1) / 2) / focal_px
        return Rays(
            ahead=math.cos(tilt_rad) + math.sin(tilt_rad) * down,
            left=((width - 1) / 2 - np.arange(width, dtype=np.float64)) / focal_px,
            up=math.sin(tilt_rad) - math.cos(tilt_rad) * down,
            forward_m=self.mount_forward_m,
            height_m=self.mount_height_m,
        )

    def points_in_base(self, depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Back-project a depth image (H, W), metres along the optical axis, into the base frame.

        Returns:
            (H, W, 3) float32 points x forward, y left, z up from the floor below the base's axis; NaN where the depth
            is invalid.
        """
        rays = self.rays(depth_m.shape[1], depth_m.shape[0])
        points = np.empty((*depth_m.shape, 3), np.float32)
        points[..., 0] = depth_m * rays.ahead.astype(np.float32)[:, None] + np.float32(rays.forward_m)
        points[..., 1] = depth_m * rays.left.astype(np.float32)[None, :]
        points[..., 2] = depth_m * rays.up.astype(np.float32)[:, None] + np.float32(rays.height_m)
        if not self.is_ahead:
            ahead, left = points[..., 0] - np.float32(rays.forward_m), points[..., 1].copy()
            cos, sin = (
                np.float32(math.cos(math.radians(self.yaw_deg))),
                np.float32(math.sin(math.radians(self.yaw_deg))),
            )
            points[..., 0] = cos * ahead - sin * left + np.float32(self.mount_forward_m)
            points[..., 1] = sin * ahead + cos * left + np.float32(self.mount_left_m)
        return points


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Back-projection of a pinhole camera: metres in the base frame per metre of depth along the optical axis.

    A pixel's point is its depth times (ahead[row], left[column], up[row]) plus the position of the lens: `forward_m`
    ahead of the base's axis and `height_m` above the floor.
    """

    ahead: npt.NDArray[np.float64]
    """(H,)."""
    left: npt.NDArray[np.float64]
    """(W,)."""
    up: npt.NDArray[np.float64]
    """(H,)."""
    forward_m: float
    height_m: float

    def points(
        self, depth_m: npt.NDArray[np.floating[Any]], rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return the points of chosen pixels in the base frame: (N,) x forward, y left, z up, metres.

        Args:
            depth_m: (N,) depth.
            rows: (N,) rows in the image.
            columns: (N,) columns in the image.
        """
        depth = depth_m.astype(np.float64)
        return (
            depth * self.ahead[rows] + self.forward_m,
            depth * self.left[columns],
            depth * self.up[rows] + self.height_m,
        )

    def pixels_nearer(
        self, depth_m: npt.NDArray[np.float32], ahead_m: float
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Return rows and columns of the valid pixels of a depth image (H, W) less than `ahead_m` ahead of the axis."""
        rows, columns = np.nonzero(depth_m * self.ahead.astype(np.float32)[:, None] < ahead_m - self.forward_m)
        return rows, columns
