"""Calibration of a camera, and rectification of its images to the ideal camera of the profile.

Models, depth guard, placement and maps use one ideal camera: square pixels, central principal point, no distortion, no
roll. Images of the real camera are resampled once, unless they are within half a pixel of the ideal camera.
"""

import math
from dataclasses import dataclass
from typing import Any, Self, TypeVar, cast

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RobotError
from vsnbench.values.camera import Camera
from vsnbench.values.pose import LEVEL, Attitude

Pixels = TypeVar("Pixels", bound=npt.NDArray[Any])

FOV_SHARE = 0.01
"""Relative difference of the profile's field of view from which a warning is reported."""
CONTRADICTION_SHARE = 0.10
"""Relative difference from which the camera, or its mode, is not that of the profile."""
_SAME_PX = 0.5
_SMOOTH = 0.1
"""Relative difference of inverse depths from which neighbouring pixels show two surfaces."""
_PINHOLE_MODELS = ("plumb_bob", "rational_polynomial")
_FISHEYE_MODELS = ("equidistant", "fisheye")
_ANGLES_RAD = np.linspace(0, math.pi, 1801)
"""Angles to the optical axis, for the inverse of a fisheye lens's polynomial."""
_OUTSIDE = 1e4
"""Stretch of a ray that the lens does not see: its pixel is outside every image."""
_WIDEST_DEG = 160.0
"""Widest advised view of a fisheye lens; a pinhole image of it shows its middle with few pixels."""
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


def rectifier_of(
    calibration: Calibration, camera: Camera, topic: str, turns: int = 0, attitude: Attitude = LEVEL
) -> "Rectifier":
    """Return the rectifier of a topic's images to the camera of the profile.

    Args:
        calibration: see Calibration.
        camera: camera of the profile.
        topic: topic of the images, for errors.
        turns: number of clockwise quarter turns that set an image upright.
        attitude: attitude of the base at the images.

    Raises:
        CalibrationError: the calibration cannot be used, or its field of view differs from the profile's by more than
            CONTRADICTION_SHARE. A fisheye lens may see more: its image is cropped.
    """
    if isinstance(calibration, CalibrationError):
        raise calibration
    if calibration is None:
        return Rectifier(camera, None, turns, attitude)
    fov_deg, wanted_deg = calibration.horizontal_fov_deg(turns), camera.horizontal_fov_deg
    differs = abs(fov_deg - wanted_deg) > CONTRADICTION_SHARE * wanted_deg
    if differs and not (calibration.is_fisheye and fov_deg > wanted_deg):
        best = f"at most {min(fov_deg, _WIDEST_DEG):.1f}" if calibration.is_fisheye else f"{fov_deg:.1f}"
        raise CalibrationError(
            f"the camera_info of {topic} has a field of view of {fov_deg:.1f}°, the profile {wanted_deg:g}°",
            advice=f"set camera.horizontal_fov_deg: {best} in the profile, or the camera driver's mode",
        )
    size = (camera.height, camera.width) if turns % 2 else (camera.width, camera.height)
    return Rectifier(camera, calibration.scaled_to(*size, topic), turns, attitude)


class Rectifier:
    """Resamples images to the camera of the profile without roll; `turns` sets them upright.

    On a base with an attitude, this is the camera `Camera.on`, which looks straight ahead over a level floor.
    """

    def __init__(
        self, camera: Camera, intrinsics: Intrinsics | None, turns: int = 0, attitude: Attitude = LEVEL
    ) -> None:
        self._turns = turns % 4
        self._shape = (camera.height, camera.width)
        rays, self._depth_per_depth = _source_rays(camera, attitude)
        pixels = _source_pixels(camera, intrinsics, self._turns, rays)
        upright = _upright_pixels(camera, self._turns)
        self.moved_px = float(np.abs(pixels - upright).max())
        """Largest shift of a pixel."""
        self._map = pixels.reshape(*self._shape, 2).astype(np.float32) if self.moved_px > _SAME_PX else None

    @property
    def resamples(self) -> bool:
        """Whether images are resampled, beyond quarter turns."""
        return self._map is not None

    def image(self, pixels: Pixels) -> Pixels:
        """Return the rectified colour image; black outside the real image."""
        if self._map is None:
            return self._upright(pixels)
        import cv2

        columns, rows = self._map[..., 0], self._map[..., 1]
        border = cv2.BORDER_CONSTANT
        black = (0, 0, 0)
        return cast("Pixels", cv2.remap(pixels, columns, rows, cv2.INTER_LINEAR, borderMode=border, borderValue=black))

    def labels(self, pixels: Pixels) -> Pixels:
        """Return the rectified labels from the nearest pixels; 0 outside the real image."""
        if self._map is None:
            return self._upright(pixels)
        rows, columns = _nearest(self._map, pixels.shape)
        found = pixels[np.maximum(rows, 0), np.maximum(columns, 0)]
        found[(rows < 0) | (columns < 0)] = 0
        return cast("Pixels", found)

    def depth(self, depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return the rectified depth (H, W); NaN outside the real image.

        Inverse depth is interpolated, which is exact on planes. At edges and next to invalid pixels the nearest pixel
        is used, so that depths of two surfaces are never mixed.
        """
        if self._map is None:
            return self._upright(depth_m)
        rows, columns = _nearest(self._map, depth_m.shape)
        found = depth_m[np.maximum(rows, 0), np.maximum(columns, 0)]
        found[(rows < 0) | (columns < 0)] = np.nan
        height, width = depth_m.shape
        left = np.clip(np.floor(self._map[..., 0]), 0, width - 2).astype(np.intp)
        top = np.clip(np.floor(self._map[..., 1]), 0, height - 2).astype(np.intp)
        across, down = self._map[..., 0] - left, self._map[..., 1] - top
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / depth_m
            corners = [inverse[top, left], inverse[top, left + 1], inverse[top + 1, left], inverse[top + 1, left + 1]]
            upper = corners[0] * (1 - across) + corners[1] * across
            lower = corners[2] * (1 - across) + corners[3] * across
            smooth = np.maximum.reduce(corners) < (1 + _SMOOTH) * np.minimum.reduce(corners)
            within = smooth & (across >= 0) & (across <= 1) & (down >= 0) & (down <= 1)
            found[within] = (1 / (upper * (1 - down) + lower * down))[within]
        return found if self._depth_per_depth is None else found * self._depth_per_depth

    def _upright(self, pixels: Pixels) -> Pixels:
        return cast("Pixels", np.ascontiguousarray(np.rot90(pixels, -self._turns))) if self._turns else pixels


def _nearest(
    source: npt.NDArray[np.float32], shape: tuple[int, ...]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return row and column of the nearest pixel; -1 outside the image."""
    columns, rows = np.rint(source[..., 0]).astype(np.intp), np.rint(source[..., 1]).astype(np.intp)
    outside = (columns < 0) | (columns >= shape[1]) | (rows < 0) | (rows >= shape[0])
    return np.where(outside, -1, rows), np.where(outside, -1, columns)


def _upright_pixels(camera: Camera, turns: int) -> npt.NDArray[np.float64]:
    """Return the column and row (H * W, 2) in the camera's image of each pixel of the upright image."""
    row, column = np.indices((camera.height, camera.width)).reshape(2, -1).astype(np.float64)
    width, height = camera.width, camera.height
    for _ in range(turns):
        # Undo one clockwise turn: (column, row) of the turned image was at (row, width - 1 - column).
        column, row, width, height = row, width - 1 - column, height, width
    return np.column_stack([column, row])


def _source_rays(
    camera: Camera, attitude: Attitude
) -> tuple[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]], npt.NDArray[np.float32] | None]:
    """Return the rays of the rectified image as the real camera sees them.

    Returns:
        (H * W,) components right and down per metre ahead, and (H, W) rectified depth per measured depth, which is not
        1 where roll and tilt together turn the optical axis to the side; None for 1.
    """
    row, column = np.indices((camera.height, camera.width)).reshape(2, -1).astype(np.float64)
    cx, cy = camera.center_px
    right, down = (column - cx) / camera.focal_px, (row - cy) / camera.focal_px
    if attitude != LEVEL:
        turn = camera.axes(attitude) @ camera.on(attitude).axes().T
        right, down, ahead = turn @ np.stack([right, down, np.ones_like(right)])
        ratio = (1 / ahead).astype(np.float32).reshape(camera.height, camera.width)
        return (right / ahead, down / ahead), None if np.allclose(ahead, 1.0, atol=1e-6) else ratio
    roll_rad = math.radians(camera.roll_deg)
    return (
        math.cos(roll_rad) * right + math.sin(roll_rad) * down,
        math.cos(roll_rad) * down - math.sin(roll_rad) * right,
    ), None


def _source_pixels(
    camera: Camera,
    intrinsics: Intrinsics | None,
    turns: int,
    rays: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]],
) -> npt.NDArray[np.float64]:
    """Return the column and row (H * W, 2) in the camera's image of the rays of `_source_rays`."""
    right, down = rays
    for _ in range(turns):
        right, down = down, -right
    if intrinsics is None:
        width, height = (camera.height, camera.width) if turns % 2 else (camera.width, camera.height)
        focal_px = camera.focal_px
        intrinsics = Intrinsics(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)
    return intrinsics.project(right, down)
