"""The temporal median over N depth images (paper, Section 3.1.4, image preprocessing): invalid pixels left out."""

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

DepthImage = npt.NDArray[np.uint16] | npt.NDArray[np.float32]


def median_depth_m(frames: Sequence[DepthImage], min_m: float = 0.0, max_m: float = 100.0) -> npt.NDArray[np.float32]:
    """Return the median of the valid measurements of each pixel.

    Args:
        frames: one or more images (H, W) of the same shape and type: uint16 millimetres with 0 for invalid, or
            float32 metres with NaN, infinity or 0 for invalid.
        min_m: nearer measurements are invalid.
        max_m: farther measurements are invalid.

    Returns:
        (H, W) float32 metres; NaN where no frame has a valid measurement. The mean of the middle two where their
        number is even.

    Raises:
        ValueError: no frames, or frames that differ in shape or type.
    """
    if not frames:
        raise ValueError("a median needs at least one depth image")
    first = frames[0]
    if any(frame.shape != first.shape or frame.dtype != first.dtype for frame in frames):
        raise ValueError("depth images of one median must have the same size and encoding")
    height, width = first.shape
    stack = np.stack([frame.reshape(-1) for frame in frames])
    out = np.empty(height * width, np.float32)
    if stack.dtype == np.uint16:
        # Ranges in the stack's own unit, so that the kernel never leaves 16 bits.
        lowest, highest = max(math.ceil(min_m * 1000), 1), min(math.floor(max_m * 1000), 65534)
        _kernel()(stack, np.uint16(lowest), np.uint16(highest), np.uint16(65535), np.float32(1000), out)
    else:
        lowest_m, highest_m = np.float32(max(min_m, 1e-6)), np.float32(min(max_m, 1e6))
        _kernel()(stack, lowest_m, highest_m, np.float32(np.inf), np.float32(1), out)
    return out.reshape(height, width)


def share_invalid(depth_m: npt.NDArray[np.float32]) -> float:
    """Return the share of pixels with no measurement, 0 to 1."""
    return float(np.count_nonzero(np.isnan(depth_m)) / depth_m.size)


@cache
def _kernel() -> Callable[..., Any]:
    """Return the compiled median; compiled on first use, and numba is imported only then."""
    from vsnbench.compilation import compiled

    return compiled(_median_of_valid)


def _median_of_valid(
    stack: Any, lowest: Any, highest: Any, invalid: Any, units_per_metre: np.float32, out: npt.NDArray[np.float32]
) -> None:
    """Fill `out` with the median in metres of the valid values in each column of `stack` (frames, pixels).

    Invalid values become `invalid`, the largest number, and the columns are sorted by a network of compare-exchanges:
    each of them runs over a row of pixels, which the compiler turns into vector instructions.
    """
    frames, pixels = stack.shape
    block = 4096
    values = np.empty((frames, block), stack.dtype)
    counts = np.empty(block, np.int32)
    for begin in range(0, pixels, block):
        size = min(block, pixels - begin)
        counts[:] = 0
        for frame in range(frames):
            row = values[frame]
            for pixel in range(size):
                value = stack[frame, begin + pixel]
                valid = value >= lowest and value <= highest
                row[pixel] = value if valid else invalid
                counts[pixel] += 1 if valid else 0
        for rounds in range(frames):
            for upper in range(1 + rounds % 2, frames, 2):
                low, high = values[upper - 1], values[upper]
                for pixel in range(size):
                    a, b = low[pixel], high[pixel]
                    low[pixel] = a if a < b else b
                    high[pixel] = b if a < b else a
        for pixel in range(size):
            count = counts[pixel]
            if count == 0:
                out[begin + pixel] = np.nan
            else:
                middle = np.float32(values[count // 2, pixel])
                other = np.float32(values[(count - 1) // 2, pixel])
                out[begin + pixel] = (middle + other) / (np.float32(2) * units_per_metre)
