"""Names the part of an image that is invalid."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

_BLOCKS = 20
"""Number of blocks across and down; a region consists of whole blocks."""
_INVALID_SHARE = 0.9
"""Smallest share of invalid pixels in a block of the region, the counterpart of `MIN_VALID_SHARE` of the guard."""
_FILLED = 0.8
"""Smallest share of a rectangle that is invalid, if the region is described as this rectangle."""
_HALF = (0.4, 0.6)
"""Shares of an image that are called a half."""


@dataclass(frozen=True, slots=True)
class Region:
    """Part of an image, as text for a message, and its share of the image."""

    text: str
    share: float


def invalid_region(invalid: npt.NDArray[np.bool_]) -> Region:
    """Return the region of the invalid pixels of an upright image (H, W); its share is 0 if there is none."""
    height, width = invalid.shape
    rows, columns = (np.unique(np.linspace(0, size, _BLOCKS + 1).astype(int)) for size in (height, width))
    sums = np.add.reduceat(np.add.reduceat(invalid.astype(float), rows[:-1], axis=0), columns[:-1], axis=1)
    blocks = sums / np.outer(np.diff(rows), np.diff(columns)) >= _INVALID_SHARE
    share = float(blocks.mean())
    if not blocks.any():
        return Region("no part of the image", 0.0)
    down, across = (np.flatnonzero(blocks.any(axis=axis)) for axis in (1, 0))
    top, bottom, left, right = down[0], down[-1] + 1, across[0], across[-1] + 1
    if blocks[top:bottom, left:right].mean() < _FILLED:
        return Region(f"{share:.0%} of the depth image", share)
    for first, last, count, before, after, other in (
        (left, right, blocks.shape[1], "left", "right", (top, bottom, blocks.shape[0])),
        (top, bottom, blocks.shape[0], "upper", "lower", (left, right, blocks.shape[1])),
    ):
        # Rectification leaves the outermost pixels invalid, or valid ones at the border of the region.
        if other[0] > 1 or other[1] < other[2] - 1:
            continue
        if first <= 1 and last >= count - 1:
            return Region("the whole depth image", share)
        if first <= 1 or last >= count - 1:
            part = last / count if first <= 1 else 1 - first / count
            size = "half" if _HALF[0] <= part <= _HALF[1] else f"{part:.0%}"
            return Region(f"the {before if first <= 1 else after} {size} of the depth image", share)
    text = f"columns {columns[left]} to {columns[right] - 1}, rows {rows[top]} to {rows[bottom] - 1} of the depth image"
    return Region(text, share)
