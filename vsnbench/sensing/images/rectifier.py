"""Rectification of a camera's images to the ideal camera of the profile.

Models, depth guard, placement and maps use one ideal camera: square pixels, central principal point, no distortion, no
roll. Images of the real camera are resampled once, unless they are within half a pixel of the ideal camera.

Depth of another size than the colour image comes from a lens of its own. Each pixel of the ideal camera takes the depth
of the same ray from the depth camera, by its own calibration; outside its view depth is invalid. The rays of both are
taken as starting at one point: lenses b metres apart shift an object at z metres by b / z radians, 15 mm at any
distance for a RealSense D435, which is less than the 2 cm margin of the depth guard.
"""

import math
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from vsnbench.sensing.images.intrinsics import Calibration, CalibrationError, Intrinsics
from vsnbench.values.camera import Camera
from vsnbench.values.pose import LEVEL, Attitude

Pixels = TypeVar("Pixels", bound=npt.NDArray[Any])

CONTRADICTION_SHARE = 0.10
"""Relative difference from which the camera, or its mode, is not that of the profile."""
_SAME_PX = 0.5
_SMOOTH = 0.1
"""Relative difference of inverse depths from which neighbouring pixels show two surfaces."""
_WIDEST_DEG = 160.0
"""Widest advised view of a fisheye lens; a pinhole image of it shows its middle with few pixels."""


def is_of_own_size(calibration: Calibration, camera: Camera, size: tuple[int, int], turns: int = 0) -> bool:
    """Return whether images of another size than the profile's can be mapped to its camera, by their calibration.

    Args:
        calibration: see Calibration.
        camera: camera of the profile.
        size: width and height of the images, before they are set upright.
        turns: number of clockwise quarter turns that set an image upright.
    """
    expected = (camera.height, camera.width) if turns % 2 else (camera.width, camera.height)
    return isinstance(calibration, Intrinsics) and size == (calibration.width, calibration.height) != expected


def rectifier_of(
    calibration: Calibration,
    camera: Camera,
    topic: str,
    turns: int = 0,
    attitude: Attitude = LEVEL,
    *,
    of_own_size: bool = False,
) -> "Rectifier":
    """Return the rectifier of a topic's images to the camera of the profile.

    Args:
        calibration: see Calibration.
        camera: camera of the profile.
        topic: topic of the images, for errors.
        turns: number of clockwise quarter turns that set an image upright.
        attitude: attitude of the base at the images.
        of_own_size: whether the images have the size of their calibration instead of the profile's, see
            `is_of_own_size`; then they may have any field of view.

    Raises:
        CalibrationError: the calibration cannot be used, or its field of view differs from the profile's by more than
            CONTRADICTION_SHARE. A fisheye lens may see more: its image is cropped.
    """
    if isinstance(calibration, CalibrationError):
        raise calibration
    if calibration is None:
        return Rectifier(camera, None, turns, attitude)
    if of_own_size:
        return Rectifier(camera, calibration, turns, attitude)
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
        size = (camera.height, camera.width) if turns % 2 else (camera.width, camera.height)
        has_own_size = intrinsics is not None and (intrinsics.width, intrinsics.height) != size
        resamples = has_own_size or self.moved_px > _SAME_PX
        self._map = pixels.reshape(*self._shape, 2).astype(np.float32) if resamples else None

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


def levelled(camera: Camera, attitude: Attitude) -> tuple[Rectifier | None, Camera]:
    """Return the rectifier of images that an ideal camera took at an attitude, and the camera of the result.

    Without a rectifier, the images are level as they are.
    """
    attitude = attitude.rounded
    return (None, camera) if attitude == LEVEL else (Rectifier(camera, None, 0, attitude), camera.on(attitude))


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
