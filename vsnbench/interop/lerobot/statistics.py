"""Statistics of the features of a dataset, which learners normalise with.

Images are counted by value, so that mean, deviation and quantiles are those of all pixels.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

QUANTILES: Mapping[str, float] = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

Statistics = dict[str, npt.NDArray[np.float64] | npt.NDArray[np.int64]]
"""`min`, `max`, `mean`, `std`, the quantiles, and `count`: the number of frames."""
Counts = npt.NDArray[np.int64]
"""(channels, values): number of pixels of each value."""


def vector_statistics(values: npt.NDArray[np.generic]) -> Statistics:
    """Return the statistics of each component.

    Args:
        values: (N, D), or (N,) for one component.

    Returns:
        Arrays of shape (D,); `count` of shape (1,).
    """
    numbers = values.astype(np.float64).reshape(len(values), -1)
    found: Statistics = {
        "min": numbers.min(axis=0),
        "max": numbers.max(axis=0),
        "mean": numbers.mean(axis=0),
        "std": numbers.std(axis=0),
        "count": np.array([len(numbers)], np.int64),
    }
    return found | {name: np.quantile(numbers, share, axis=0) for name, share in QUANTILES.items()}


def pixel_counts(pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> Counts:
    """Return how often each value occurs in each channel of an image, (H, W, C) or (H, W)."""
    channels = pixels.reshape(pixels.shape[0] * pixels.shape[1], -1)
    values = np.iinfo(pixels.dtype).max + 1
    return np.stack([np.bincount(channels[:, k], minlength=values) for k in range(channels.shape[1])])


def image_statistics(counts: Counts, images: int, full_scale: float = 1.0) -> Statistics:
    """Return the statistics of each channel.

    Args:
        counts: sum of `pixel_counts` of the images.
        images: number of images.
        full_scale: value that becomes 1.

    Returns:
        Arrays of shape (C, 1, 1); `count` of shape (1,).
    """
    values = np.arange(counts.shape[1], dtype=np.float64)
    rows = [_of_channel(channel, values) for channel in counts]
    found: Statistics = {
        name: np.array([row[name] for row in rows]).reshape(-1, 1, 1) / full_scale
        for name in ("min", "max", "mean", "std", *QUANTILES)
    }
    return found | {"count": np.array([images], np.int64)}


def _of_channel(counts: npt.NDArray[np.int64], values: npt.NDArray[np.float64]) -> dict[str, float]:
    below = np.cumsum(counts)
    total = int(below[-1])
    present = np.flatnonzero(counts)
    mean = float(counts @ values) / total
    found = {
        "min": float(present[0]),
        "max": float(present[-1]),
        "mean": mean,
        "std": float(np.sqrt(counts @ (values - mean) ** 2 / total)),
    }
    for name, share in QUANTILES.items():
        place = share * (total - 1)
        lower = int(place)
        low, high = np.searchsorted(below, [lower, min(lower + 1, total - 1)], side="right")
        found[name] = float(low + (place - lower) * (high - low))
    return found
