"""Reproducible stand-in weights for VLV's value network: every tensor drawn from a generator seeded by its own key."""

import zlib

import numpy as np


def state_dict(shapes: dict[str, tuple[int, ...]], salt: str = "a") -> dict[str, np.ndarray]:
    """Return arrays for `shapes`. Variances are positive, batch-norm scales near 1, weights scaled by fan-in."""
    out = {}
    for key, shape in shapes.items():
        rng = np.random.default_rng(zlib.crc32(f"{salt}:{key}".encode()))
        draw = rng.standard_normal(shape)
        if key.endswith("num_batches_tracked"):
            value = np.array(1000)
        elif key.endswith("running_var"):
            value = 1.0 + 0.1 * np.abs(draw)
        elif key.endswith(("running_mean", "bias")):
            value = 0.05 * draw
        elif len(shape) == 1:
            value = 1.0 + 0.1 * draw
        else:
            value = draw * np.sqrt(2.0 / np.prod(shape[1:]))
        out[key] = value.astype(np.int64 if key.endswith("num_batches_tracked") else np.float32)
    return out
