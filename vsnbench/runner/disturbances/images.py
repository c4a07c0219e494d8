"""Disturbances of single images: pure functions of an image, a value and a random number generator."""

import math

import numpy as np
import numpy.typing as npt

from vsnbench.values.camera import Camera

_WIDTH_PX = 640
"""Width of the images in which blur is given."""
_VEIL_COSINE = 0.5
"""Cosine of the angle from the lamp at which the veil ends: 60 degrees."""
_LAMP_ABOVE_RAD = 0.15
_GAMMA = 2.2
_FULL_WELL = 4000.0
"""Electrons of a white pixel under full light; their shot noise is the square root."""
_READ_NOISE = 8.0
"""Electrons; the same in every light."""
_ELECTRONS = np.array([_FULL_WELL * (level / 255) ** _GAMMA for level in range(256)], np.float32)
_LEVELS = np.array([round(255 * (step / 4095) ** (1 / _GAMMA)) for step in range(4096)], np.uint8)
"""Tables instead of powers of arrays, whose last bits differ between processors."""
_PATCH_PX = 20
"""Side of a patch of lost depth in an image 640 pixels wide."""


def blur(rgb: npt.NDArray[np.uint8], value: float) -> npt.NDArray[np.uint8]:
    """Return the (H, W, 3) image with a Gaussian blur.

    `value` is its standard deviation in pixels of an image 640 pixels wide.
    """
    import cv2

    sigma = value * rgb.shape[1] / _WIDTH_PX
    return np.asarray(cv2.GaussianBlur(rgb, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE), np.uint8)


def glare(rgb: npt.NDArray[np.uint8], value: float, camera: Camera, lamp_rad: float) -> npt.NDArray[np.uint8]:
    """Return the (H, W, 3) image with a veil of white light around a lamp.

    `value` is the share of white at the lamp, and `lamp_rad` its heading in the robot's frame, counter-clockwise.
    """
    rays = camera.rays(rgb.shape[1], rgb.shape[0])
    ahead, left, up = rays.ahead[:, None], rays.left[None, :], rays.up[:, None]
    level = math.cos(_LAMP_ABOVE_RAD)
    towards = math.cos(lamp_rad) * level * ahead + math.sin(lamp_rad) * level * left + math.sin(_LAMP_ABOVE_RAD) * up
    cosine = towards / np.sqrt(ahead * ahead + left * left + up * up)
    near = np.maximum((cosine - _VEIL_COSINE) / (1 - _VEIL_COSINE), 0)
    veil = (value * near * near).astype(np.float32)[..., None]
    image = rgb.astype(np.float32)
    return np.rint(image + veil * (255 - image)).astype(np.uint8)


def low_light(rgb: npt.NDArray[np.uint8], value: float, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return the (H, W, 3) image without the share `value` of its light, with a camera's shot noise and read noise."""
    electrons = (_ELECTRONS * np.float32(1 - value))[rgb]
    noise = rng.standard_normal(rgb.shape, dtype=np.float32)
    electrons += noise * np.sqrt(electrons + np.float32(_READ_NOISE**2))
    steps = np.rint(np.clip(electrons / np.float32(_FULL_WELL), 0, 1) * np.float32(4095)).astype(np.int16)
    return np.asarray(_LEVELS[steps], np.uint8)


def depth_holes(
    depth_m: npt.NDArray[np.float32], value: float, rng: np.random.Generator
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Return the (H, W) depth image in metres with NaN patches on the share `value` of it, and the patches."""
    height, width = depth_m.shape
    side = max(1, round(_PATCH_PX * width / _WIDTH_PX))
    grid = rng.random((-(-height // side), -(-width // side))) < value
    lost = np.repeat(np.repeat(grid, side, axis=0), side, axis=1)[:height, :width]
    return np.where(lost, np.float32(np.nan), depth_m), lost
