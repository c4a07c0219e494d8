"""Resizes and crops a camera image bit by bit like the original's resizer, on every processor.

Bilinear, no antialiasing. Every rounding follows the one on which the original's outputs were recorded, which
multiplies and adds in one step: a level more or less at some pixels, as other resizers have it, shows in the logits.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from vsnbench.runtime.numba_cache import compiled

Floats = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]


def crop_of_resized(rgb: npt.NDArray[np.uint8], size_px: int) -> npt.NDArray[np.uint8]:
    """Resize the shorter side of an image (H, W, 3) to `size_px`. Returns the central square (size_px, size_px, 3)."""
    height, width = rgb.shape[:2]
    shorter = min(height, width)
    rows, columns = _samples(height, shorter, size_px), _samples(width, shorter, size_px)
    out = np.empty((size_px, size_px, 3), np.uint8)
    _sample(rgb, *rows, *columns, out)
    return out


@lru_cache(maxsize=16)
def _samples(side: int, shorter: int, size_px: int) -> tuple[Indices, Indices, Floats, Floats]:
    """Return the two neighbours of every pixel of the crop along an axis of `side` pixels, and their weights."""
    resized = size_px * side // shorter
    first = round((resized - size_px) / 2)
    scale = np.float64(np.float32(side) / np.float32(resized))
    centres = np.arange(first, first + size_px, dtype=np.float32) + np.float32(0.5)
    place = np.maximum((centres * scale - 0.5).astype(np.float32), np.float32(0))
    before = place.astype(np.int64)
    after_weight = place - before.astype(np.float32)
    after = np.minimum(before + 1, side - 1)
    return before, after, np.float32(1) - after_weight, after_weight


@compiled
def _mix(a: np.float32, a_weight: np.float32, b: np.float32, b_weight: np.float32) -> np.float32:
    """Return a * a_weight + b * b_weight without rounding the first product, which doubles represent exactly."""
    return np.float32(np.float64(a) * np.float64(a_weight) + np.float64(np.float32(b * b_weight)))


@compiled
def _sample(  # noqa: PLR0913 - compiled functions take arrays, not objects
    rgb: npt.NDArray[np.uint8],
    upper_rows: Indices,
    lower_rows: Indices,
    upper_weights: Floats,
    lower_weights: Floats,
    left_columns: Indices,
    right_columns: Indices,
    left_weights: Floats,
    right_weights: Floats,
    out: npt.NDArray[np.uint8],
) -> None:
    for row in range(out.shape[0]):
        upper, lower = rgb[upper_rows[row]], rgb[lower_rows[row]]
        for column in range(out.shape[1]):
            left, right = left_columns[column], right_columns[column]
            left_weight, right_weight = left_weights[column], right_weights[column]
            for channel in range(3):
                above = _mix(
                    np.float32(upper[left, channel]), left_weight, np.float32(upper[right, channel]), right_weight
                )
                below = _mix(
                    np.float32(lower[left, channel]), left_weight, np.float32(lower[right, channel]), right_weight
                )
                out[row, column, channel] = np.uint8(
                    np.rint(_mix(above, upper_weights[row], below, lower_weights[row]))
                )
