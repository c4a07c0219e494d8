"""Calibration of a camera: where a lens shows a ray, and which ray a pixel shows."""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RobotError

FOV_SHARE = 0.01
"""Relative difference of the profile's field of view from which a warning is reported."""
_PINHOLE_MODELS = ("plumb_bob", "rational_polynomial")
_FISHEYE_MODELS = ("equidistant", "fisheye")
_ANGLES_RAD = np.linspace(0, math.pi, 1801)
"""Angles to the optical axis, for the inverse of a fisheye lens's polynomial."""
_OUTSIDE = 1e4
"""Stretch of a ray that the lens does not see: its pixel is outside every image."""
_COEFFICIENTS = {0, 4, 5, 8, 12, 14}
_SQUARE = 0.2
"""Largest relative difference of the focal lengths."""


class CalibrationError(RobotError):
    """A camera_info that cannot be used, or that contradicts the profile."""

    code = "invalid-calibration"


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Calibration of a camera in pixels of its image; the centre of pixel (0, 0) is at (0, 0)."""

    width: int
    height: int
    focal_x_px: float
    focal_y_px: float
    center_x_px: float
    center_y_px: float
    distortion: tuple[float, ...] = ()
    """Empty for none."""
    distortion_model: str = ""
    """Empty for a pinhole camera; a fisheye lens is one without coefficients, too."""

    @classmethod
    def of(cls, info: Any, topic: str) -> Self | None:
        """Return the intrinsics in a sensor_msgs/CameraInfo; None if the camera is not calibrated.

        Args:
            info: message of ROS 1 or ROS 2.
            topic: topic of the images. The images `image_rect*` of image_proc have no distortion and follow P.

        Raises:
            CalibrationError: the calibration cannot be used.
        """
        # Field names are upper case in ROS 1 and lower case in ROS 2.
        k, d, p = (list(getattr(info, name if hasattr(info, "K") else name.lower())) for name in ("K", "D", "P"))
        if len(k) != 9 or not k[0]:
            return None
        fx, fy, cx, cy = k[0], k[4], k[2], k[5]
        distortion, model = tuple(map(float, d)), str(info.distortion_model)
        if topic.rpartition("/")[2].startswith("image_rect"):
            distortion, model = (), ""
            if len(p) == 12 and p[0]:
                fx, fy, cx, cy = p[0], p[5], p[2], p[6]
        if not all(map(math.isfinite, (fx, fy, cx, cy, *distortion))) or fx <= 0 or abs(fy / fx - 1) > _SQUARE:
            raise CalibrationError(
                f"the camera_info of {topic} cannot be used: focal lengths {fx:g} and {fy:g} px",
                advice="calibrate the camera, or leave its camera_info out of the profile",
            )
        if not any(distortion):
            # An equidistant lens without coefficients images at focal length times angle, unlike a pinhole.
            distortion, model = (), model if model in _FISHEYE_MODELS else ""
        known = (*_PINHOLE_MODELS, *_FISHEYE_MODELS)
        if distortion and (model not in known or len(distortion) not in _COEFFICIENTS):
            raise CalibrationError(
                f"the camera_info of {topic} has the distortion model {model!r} with {len(distortion)} coefficients, "
                f"not one of {', '.join(known)}",
                advice="rectify the images with image_proc, and use its topics in the profile",
            )
        return cls(int(info.width), int(info.height), fx, fy, cx, cy, distortion, model)

    @property
    def is_fisheye(self) -> bool:
        """Whether the lens images at a function of the angle, and may see more than a pinhole can."""
        return self.distortion_model in _FISHEYE_MODELS

    def horizontal_fov_deg(self, turns: int = 0) -> float:
        """Return the horizontal field of view of the upright image, degrees."""
        width, focal_px = (self.height, self.focal_y_px) if turns % 2 else (self.width, self.focal_x_px)
        if not self.is_fisheye:
            return math.degrees(2 * math.atan(width / 2 / focal_px))
        radii, limit = self._fisheye_radii()
        return math.degrees(2 * float(np.interp(width / 2 / focal_px, radii[:limit], _ANGLES_RAD[:limit])))

    def scaled_to(self, width: int, height: int, topic: str) -> Self:
        """Return the intrinsics for another resolution.

        Raises:
            CalibrationError: the image has another aspect ratio than the calibration.
        """
        if (width, height) == (self.width, self.height):
            return self
        across, down = width / self.width, height / self.height
        if abs(across / down - 1) > 0.01:
            raise CalibrationError(
                f"the camera_info of {topic} is for {self.width}x{self.height}, the image is {width}x{height}",
                advice="set the mode of the camera driver so that both agree",
            )
        return type(self)(
            width,
            height,
            self.focal_x_px * across,
            self.focal_y_px * down,
            (self.center_x_px + 0.5) * across - 0.5,
            (self.center_y_px + 0.5) * down - 0.5,
            self.distortion,
            self.distortion_model,
        )

    def project(self, right: npt.NDArray[np.float64], down: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the pixels (N, 2), column and row, of rays with (N,) components right and down per metre ahead."""
        if self.is_fisheye:
            reach = np.hypot(right, down)
            angle = np.arctan(reach)
            stretch = np.where(reach > 1e-9, self._fisheye_radius(angle) / np.maximum(reach, 1e-9), 1.0)
            _, limit = self._fisheye_radii()
            stretch = np.where(angle <= _ANGLES_RAD[limit - 1], stretch, _OUTSIDE)
            right, down = right * stretch, down * stretch
        elif self.distortion:
            import cv2

            rays = np.column_stack([right, down, np.ones_like(right)])
            zero, unit = np.zeros(3), np.eye(3)
            bent, _ = cv2.projectPoints(rays, zero, zero, unit, np.array(self.distortion))
            right, down = bent[:, 0, 0], bent[:, 0, 1]
        return np.column_stack([self.focal_x_px * right + self.center_x_px, self.focal_y_px * down + self.center_y_px])

    def _fisheye_radius(self, angle_rad: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the distances from the principal point of rays at angles to the optical axis, per focal length."""
        powers = sum(k * angle_rad ** (2 * number + 2) for number, k in enumerate(self.distortion[:4]))
        return angle_rad * (1 + powers)

    def _fisheye_radii(self) -> tuple[npt.NDArray[np.float64], int]:
        """Return the radii at _ANGLES_RAD, and how many of them increase: rays beyond are not in the image."""
        radii = self._fisheye_radius(_ANGLES_RAD)
        falls = np.flatnonzero(np.diff(radii) <= 0)
        return radii, int(falls[0]) + 1 if falls.size else radii.size


Calibration = Intrinsics | CalibrationError | None
"""Received calibration: its error if it cannot be used, None for an uncalibrated camera or without camera_info."""
