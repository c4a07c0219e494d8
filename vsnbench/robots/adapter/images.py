"""Images of an adapter as an observation."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError
from vsnbench.robots.adapter.messages import arrays_in, colours_in, depth_in, stamp_in
from vsnbench.sensing.images.camera_images import beyond_range, median_depth_m, share_invalid
from vsnbench.sensing.images.depth_range import range_fault
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

_MAX_INVALID = 0.9
"""Share of invalid depth from which its unit is suspected."""


def observed(
    message: Mapping[str, Any], camera: Camera, pose: Pose, sensing: Mapping[str, float], sensors: frozenset[Sensor]
) -> Observation:
    """Return the observation of a message.

    Args:
        message: an `observation`.
        camera: camera of the profile.
        pose: odometry since the start of the episode.
        sensing: how the observation was made, for the record.
        sensors: sensors of the adapter's card.

    Raises:
        InvalidAnswerError: an image or array cannot be read.
        SensorLostError: an image does not fit the camera.
    """
    rgb, depth_m, beyond = colours_in(message), None, None
    _require_size("colour", rgb, camera)
    if Sensor.DEPTH in sensors:
        raw, beyond = depth_in(message)
        depth_m = in_range(raw, camera)
        beyond = beyond_range(raw, depth_m, camera.depth_max_m) if beyond is None else beyond & np.isnan(depth_m)
        invalid = share_invalid(depth_m)
        if invalid > _MAX_INVALID and (fault := range_fault(raw, camera)):
            raise SensorLostError(
                fault, advice="check the unit: f32 is in metres, mm16 in millimetres", code="wrong-depth-range"
            )
        sensing = {**sensing, "invalid_after": invalid}
    stamp_s = stamp_in(message)
    return Observation(
        rgb=rgb,
        depth_m=depth_m,
        pose=pose,
        stamp_s=stamp_s,
        camera=camera.without_roll,
        depth_stamp_s=None if depth_m is None else stamp_in(message, "depth_stamp_s", stamp_s),
        beyond_range=beyond,
        sensing={name: number for name, number in sensing.items() if math.isfinite(number)},
        **arrays_in(message, sensors),
    )


def in_range(raw: npt.NDArray[np.float32], camera: Camera) -> npt.NDArray[np.float32]:
    """Return a depth image (H, W) in metres, NaN beyond the camera's range.

    Raises:
        SensorLostError: it has another size than the camera.
    """
    _require_size("depth", raw, camera)
    return median_depth_m([raw], camera.depth_min_m, camera.depth_max_m)


def _require_size(what: str, image: npt.NDArray[Any], camera: Camera) -> None:
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise SensorLostError(
            f"the {what} image is {width}x{height}, the profile has {camera.width}x{camera.height}",
            advice="set the mode of the camera, or the camera of the profile",
            code="wrong-image-size",
        )
