"""Motion blur: the mean of views along the way that a camera moves while an image is exposed."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.rendering.renderer import Renderer
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Attitude, Pose

_SHARP_PX: Final = 0.5
"""A smaller motion during the exposure does not blur an image."""
_MOST_VIEWS: Final = 12
"""Number of views in the mean of a blurred image, at most."""
_NEAR_M: Final = 1.0
"""Distance of what the motion of the base is to blur smoothly; there is a view for each pixel by which it moves."""


def exposed(
    rgb: npt.NDArray[np.uint8], camera: Camera, renderer: Renderer, seen: Callable[[float], tuple[Pose, Attitude]]
) -> npt.NDArray[np.uint8]:
    """Return an image (H, W, 3) as it is exposed from `camera.exposure_s` ago until now.

    Args:
        rgb: (H, W, 3) the view of now.
        camera: the camera.
        renderer: draws the other views.
        seen: returns pose and attitude of the base some seconds ago.
    """
    if not camera.exposure_s:
        return rgb
    moved_px = _motion_px(camera, seen(0.0), seen(camera.exposure_s))
    if moved_px < _SHARP_PX:
        return rgb
    count = min(math.ceil(moved_px) + 1, _MOST_VIEWS)
    total = rgb.astype(np.uint32)
    for k in range(1, count):
        total += renderer.look(camera, *seen(k / (count - 1) * camera.exposure_s)).rgb
    return ((total + count // 2) // count).astype(np.uint8)


def _motion_px(camera: Camera, now: tuple[Pose, Attitude], then: tuple[Pose, Attitude]) -> float:
    """Return about how far the image of something near moves between two poses, pixels."""
    (here, attitude), (before, other) = now, then
    turned_rad = abs(math.remainder(here.heading_rad - before.heading_rad, math.tau))
    turned_rad += abs(attitude.roll_rad - other.roll_rad) + abs(attitude.pitch_rad - other.pitch_rad)
    return camera.focal_px * (turned_rad + here.distance_to(before) / _NEAR_M)
