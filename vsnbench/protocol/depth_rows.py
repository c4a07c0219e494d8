"""Inner loops over depth images: to millimetres, to the rows of a PNG, what lies ahead. One thread, without the GIL."""

from typing import Any

import numpy as np

from vsnbench.compilation import compiled

UP = 2
"""PNG's filter that takes each byte as its difference to the one above: rows of depth resemble each other."""


@compiled
def to_millimetres(depth_m: Any, millimetres: Any) -> None:
    """Write what is nearest in whole millimetres, halves to even; 0 for what is invalid or farther than 65.535 m.

    Args:
        depth_m: (H, W) float32.
        millimetres: (H, W) uint16, written.
    """
    height, width = depth_m.shape
    for row in range(height):
        for column in range(width):
            whole = np.rint(depth_m[row, column] * np.float32(1000))
            holds = (whole > np.float32(0)) & (whole <= np.float32(65535))
            millimetres[row, column] = np.uint16(np.int32(whole if holds else np.float32(0)))


@compiled
def filter_up(values: Any, rows: Any) -> None:
    """Write the rows of a PNG with 16 bits a pixel, most significant byte first, under the filter `UP`.

    Args:
        values: (H, W) uint16.
        rows: (H, 1 + 2 W) uint8, written.
    """
    height, width = values.shape
    for row in range(height):
        rows[row, 0] = UP
        for column in range(width):
            here = np.uint32(values[row, column])
            above = np.uint32(values[row - 1, column]) if row > 0 else np.uint32(0)
            rows[row, 1 + 2 * column] = np.uint8((here >> 8) - (above >> 8))
            rows[row, 2 + 2 * column] = np.uint8(here - above)


@compiled
def pixels_in_swath(
    depth_m: Any,
    near_m: Any,
    near_ahead: Any,
    ahead: Any,
    left: Any,
    up: Any,
    forward_m: float,
    height_m: float,
    half_width_m: float,
    lowest_m: float,
    highest_m: float,
) -> tuple[int, float]:
    """Count the pixels whose points lie in a box before a robot; see `vsnbench.protocol.camera.Rays` for the rays.

    Args:
        depth_m: (H, W) float32, metres along the optical axis; what is not a number lies nowhere.
        near_m: float32, how far before the lens the box ends.
        near_ahead: (H,) float32, `ahead` as single numbers: by them, as by `Rays.pixels_nearer`, a pixel is near.
        ahead: (H,) float64.
        left: (W,) float64.
        up: (H,) float64.
        forward_m: of the lens before the base's axis.
        height_m: of the lens above the floor.
        half_width_m: of the box, to both sides.
        lowest_m: height of its floor.
        highest_m: height of its ceiling.

    Returns:
        how many, and how far before the base's axis the nearest is, metres; infinite where there is none.
    """
    height, width = depth_m.shape
    pixels, nearest_m = 0, np.inf
    for row in range(height):
        for column in range(width):
            if depth_m[row, column] * near_ahead[row] < near_m:
                depth = np.float64(depth_m[row, column])
                rise_m = depth * up[row] + height_m
                if abs(depth * left[column]) <= half_width_m and lowest_m <= rise_m <= highest_m:
                    pixels += 1
                    nearest_m = min(nearest_m, depth * ahead[row] + forward_m)
    return pixels, nearest_m
