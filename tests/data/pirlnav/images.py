"""The 20 fixed 640x480 RGB frames that expected.npz was recorded on: blobs, rectangles and noise from numpy's PCG64."""

import numpy as np


def frames(n: int = 20, height: int = 480, width: int = 640, seed: int = 20240) -> np.ndarray:
    """Return uint8 images of shape (n, height, width, 3)."""
    rng = np.random.default_rng(seed)
    out = np.empty((n, height, width, 3), np.uint8)
    for i in range(n):
        low = rng.random((9, 12, 3))
        yy, xx = np.linspace(0, 8, height), np.linspace(0, 11, width)
        y0, x0 = np.minimum(yy.astype(int), 7), np.minimum(xx.astype(int), 10)
        fy, fx = (yy - y0)[:, None, None], (xx - x0)[None, :, None]
        image = (
            low[y0][:, x0] * (1 - fy) * (1 - fx)
            + low[y0 + 1][:, x0] * fy * (1 - fx)
            + low[y0][:, x0 + 1] * (1 - fy) * fx
            + low[y0 + 1][:, x0 + 1] * fy * fx
        )
        for _ in range(12):
            top, bottom = sorted(rng.integers(0, height, 2))
            left, right = sorted(rng.integers(0, width, 2))
            image[top:bottom, left:right] = image[top:bottom, left:right] * 0.4 + rng.random(3) * 0.6
        noise = rng.integers(-12, 13, (height, width, 3))
        out[i] = np.clip(image * 230 + noise + 12, 0, 255).astype(np.uint8)
    return out
