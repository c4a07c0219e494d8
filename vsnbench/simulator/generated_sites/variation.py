"""Variation of camera and lighting between generated sites."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.values.camera import Camera


@dataclass(frozen=True, slots=True)
class CameraVariation:
    """Range of each property of the camera."""

    mount_height_m: tuple[float, float] = (0.45, 0.9)
    tilt_deg: tuple[float, float] = (-8.0, 8.0)
    horizontal_fov_deg: tuple[float, float] = (54.0, 79.0)

    def draw(self, camera: Camera, seed: int) -> Camera:
        """Return a camera with the height, tilt and field of view of a seed."""
        rng = np.random.default_rng([seed, 0xCA])
        return camera.model_copy(
            update={
                "mount_height_m": round(float(rng.uniform(*self.mount_height_m)), 3),
                "tilt_deg": round(float(rng.uniform(*self.tilt_deg)), 2),
                "horizontal_fov_deg": round(float(rng.uniform(*self.horizontal_fov_deg)), 2),
            }
        )


@dataclass(frozen=True, slots=True)
class Lighting:
    """Lighting and camera settings that change a finished image."""

    exposure: float
    white_balance: tuple[float, float, float]
    gamma: float

    @classmethod
    def draw(cls, seed: int) -> "Lighting":
        """Return the lighting of a seed: from dusk to noon, from lamp light to an overcast sky."""
        rng = np.random.default_rng([seed, 0x11])
        warmth = float(rng.uniform(-0.12, 0.12))
        tint = float(rng.uniform(-0.03, 0.03))
        return cls(float(rng.uniform(0.65, 1.25)), (1 + warmth, 1 + tint, 1 - warmth), float(rng.uniform(0.85, 1.2)))

    def apply(self, rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """Return the image (H, W, 3) uint8 with this lighting."""
        levels = np.linspace(0.0, 1.0, 256)
        tables = [np.clip(self.exposure * gain * levels**self.gamma, 0, 1) * 255 for gain in self.white_balance]
        lit = np.empty_like(rgb)
        for channel, table in enumerate(tables):
            lit[..., channel] = np.rint(table).astype(np.uint8)[rgb[..., channel]]
        return lit
