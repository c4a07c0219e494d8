"""Check of the range of a depth image, which reveals a wrong unit."""

import numpy as np

from vsnbench.sensing.images.camera_images import DepthImage
from vsnbench.values.camera import Camera

_MAX_SHARE = 0.9
"""Share of measurements out of range from which the unit is wrong."""
_FEWEST = 0.01
"""Smallest share of measured pixels for a judgement."""
_BEYOND_FACTOR = 2.0
"""Cameras report some depth beyond their range; a wrong unit differs by a factor of ten or more."""
_NEARER_SHARE = 0.1
_NEAREST_M = 0.01


def range_fault(depth: DepthImage, camera: Camera) -> str:
    """Return the fault of the range of a raw depth image, or an empty string.

    Args:
        depth: (H, W) uint16 millimetres or float32 metres.
        camera: camera of the profile.
    """
    if depth.dtype == np.uint16:
        measured_m = depth[(depth > 0) & (depth < 65535)] / 1000.0
    else:
        measured_m = depth[np.isfinite(depth) & (depth > 0)].astype(np.float64)
    if measured_m.size < max(1.0, _FEWEST * depth.size):
        return ""
    beyond = float(np.mean(measured_m > _BEYOND_FACTOR * camera.depth_max_m))
    nearer = float(np.mean(measured_m < max(_NEARER_SHARE * camera.depth_min_m, _NEAREST_M)))
    if max(beyond, nearer) < _MAX_SHARE:
        return ""
    low_m, high_m = np.percentile(measured_m, [5, 95])
    return (
        f"the depth image measures {low_m:.3g} to {high_m:.3g} m; the camera of the profile measures "
        f"{camera.depth_min_m:g} to {camera.depth_max_m:g} m"
    )


WRONG_UNIT = "check the unit: 32FC1 is in metres, 16UC1 in millimetres"
"""Advice for an image that is out of range."""
