"""Inner loops over depth images: metres to millimetres, and to the rows of a PNG. One thread, without the GIL."""

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
