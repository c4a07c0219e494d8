"""Kernels over depth images: millimetres, rows of a PNG, obstacles ahead. One thread, without the GIL."""

from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled

UP = 2
"""PNG filter that replaces each byte by its difference from the byte above; adjacent rows of depth are similar."""


@compiled
def to_millimetres(depth_m: Any, millimetres: Any) -> None:
    """Write depth rounded to whole millimetres, halves to even; 0 if invalid or above 65.535 m.

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
    """Write the rows of a PNG with 16 bits per pixel, most significant byte first, with the filter `UP`.

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
def pixels_in_swath(  # noqa: PLR0913 - compiled functions take arrays, not objects
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
    """Count the pixels whose points are in a box ahead of a robot; see `vsnbench.values.camera.Rays` for the rays.

    Args:
        depth_m: (H, W) float32, metres along the optical axis; NaN is in no box.
        near_m: float32, distance from the lens to the end of the box.
        near_ahead: (H,) float32, `ahead` in single precision, for the same comparison as in `Rays.pixels_nearer`.
        ahead: (H,) float64.
        left: (W,) float64.
        up: (H,) float64.
        forward_m: distance of the lens ahead of the base's axis.
        height_m: height of the lens above the floor.
        half_width_m: half the width of the box.
        lowest_m: height of the bottom of the box.
        highest_m: height of the top of the box.

    Returns:
        Number of pixels, and distance of the nearest one ahead of the base's axis, metres; infinity if there is none.
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


@compiled
def count_valid_in_cells(depth_m: Any, cells: Any, farthest_m: Any, valid: Any) -> None:
    """Add the number of valid pixels of each cell to `valid`.

    Args:
        depth_m: (H, W) float32, metres; NaN, 0 and infinity are invalid.
        cells: (H, W) int32, cell number of each pixel, or -1.
        farthest_m: float32, maximum valid depth.
        valid: (N,) int64, written.
    """
    height, width = cells.shape
    for row in range(min(height, depth_m.shape[0])):
        for column in range(width):
            cell = cells[row, column]
            if cell >= 0 and depth_m[row, column] > 0 and depth_m[row, column] <= farthest_m:
                valid[cell] += 1
