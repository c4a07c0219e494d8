"""Converts camera images to the network's input, optionally with the augmentation of training."""

from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.float32]

_JITTER: Final = 0.4
"""Strength of each colour change in training."""
_SHIFT_PX: Final = 16
"""Largest shift of the image in training."""
_LEVELS: Final = np.arange(256, dtype=np.float32) / np.float32(255)
_LUMA: Final = np.array([0.299, 0.587, 0.114], np.float32)


def preprocess(rgb: npt.NDArray[np.uint8], size_px: int) -> Image:
    """Convert a camera image (H, W, 3) to the network's input: (size_px, size_px, 3) float32 in [0, 1].

    The shorter side is resized to `size_px` bilinearly WITHOUT antialiasing, rounded to whole levels, and the centre is
    cropped.
    """
    from vsnbench.models.pirlnav.resampling import crop_of_resized

    return _LEVELS[crop_of_resized(rgb, size_px)]


def augment(image: Image, random: np.random.Generator) -> Image:
    """Apply the colour jitter and shift of training to an image (S, S, 3) in [0, 1].

    The published code also used them in evaluation.
    """
    changes = [_brighten, _contrast, _saturate, _turn_hue]
    for index in random.permutation(len(changes)):
        image = changes[index](image, random)
    size = image.shape[0]
    padded = cv2.copyMakeBorder(image, _SHIFT_PX, _SHIFT_PX, _SHIFT_PX, _SHIFT_PX, cv2.BORDER_REPLICATE)
    top, left = random.integers(0, 2 * _SHIFT_PX + 1, 2)
    return np.ascontiguousarray(padded[top : top + size, left : left + size])


def _factor(random: np.random.Generator) -> np.float32:
    return np.float32(random.uniform(1 - _JITTER, 1 + _JITTER))


def _blend(image: Image, other: Image | np.float32, factor: np.float32) -> Image:
    mixed: Image = np.clip(image * factor + other * (np.float32(1) - factor), 0, 1)
    return mixed


def _brighten(image: Image, random: np.random.Generator) -> Image:
    return _blend(image, np.float32(0), _factor(random))


def _contrast(image: Image, random: np.random.Generator) -> Image:
    return _blend(image, np.float32((image @ _LUMA).mean()), _factor(random))


def _saturate(image: Image, random: np.random.Generator) -> Image:
    grey: Image = (image @ _LUMA)[..., None]
    return _blend(image, grey, _factor(random))


def _turn_hue(image: Image, random: np.random.Generator) -> Image:
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    hsv[..., 0] = (hsv[..., 0] + np.float32(random.uniform(-_JITTER, _JITTER) * 360)) % 360
    turned: Image = np.clip(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB), 0, 1)
    return turned
