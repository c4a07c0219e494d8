"""Textures of a scan's file: their pixels, within limits, and what no triangle shows of them."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.simulator.rendering.scan.mesh import MOST_TEXELS, MOST_TEXTURES, TEXTURE_STEP, Bytes
from vsnbench.simulator.rendering.scan.pixels import fill_holes, mark_triangles

_MOST_OVERLAPS = 10
_FORMATS = ("PNG", "JPEG", "WEBP")


def texture_pixels(images: list[Any]) -> list[Bytes]:
    """Return the pixels of images, scaled to sides that are multiples of TEXTURE_STEP and to MOST_TEXELS in total."""
    import cv2

    if len(images) > MOST_TEXTURES:
        raise ValueError(f"it has more than {MOST_TEXTURES} textures")
    if not all(isinstance(getattr(image, "size", None), tuple) for image in images):
        raise ValueError("a texture is not an image")
    sizes = [image.size for image in images]
    if any(image.format not in (*_FORMATS, None) for image in images):
        raise ValueError("a texture is neither PNG, JPEG nor WebP")
    if any(width * height > 2 * MOST_TEXELS for width, height in sizes):
        raise ValueError(f"a texture has more than {2 * MOST_TEXELS:,} pixels")
    total = sum(width * height for width, height in sizes)
    shrink = min(1.0, math.sqrt(0.9 * MOST_TEXELS / max(total, 1)), *(4096 / max(size) for size in sizes))
    pictures = []
    for image in images:
        try:
            pixels = np.asarray(image.convert("RGB"), np.uint8)
        except Exception as problem:
            raise ValueError(f"a texture cannot be decoded ({type(problem).__name__})") from problem
        high, wide = (max(round(side * shrink / TEXTURE_STEP), 1) * TEXTURE_STEP for side in pixels.shape[:2])
        if (high, wide) != pixels.shape[:2]:
            smaller = wide * high < pixels.shape[0] * pixels.shape[1]
            pixels = np.asarray(
                cv2.resize(pixels, (wide, high), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR),
                np.uint8,
            )
        pictures.append(np.ascontiguousarray(pixels).copy())
    return pictures


def fill_unused(picture: Bytes, uv: npt.NDArray[np.float32]) -> None:
    """Fill the pixels of a texture that no triangle shows, so that its smaller sizes have no foreign colours."""
    if not ((uv > -0.01) & (uv < 1.01)).all():
        return  # it repeats
    corners = uv * np.array(picture.shape[1::-1], np.float32)
    boxes = (corners.max(axis=1) - corners.min(axis=1) + 3).astype(np.float64).prod(axis=1)
    if boxes.sum() > _MOST_OVERLAPS * picture.size:
        return  # triangles share its pixels
    shown = np.zeros(picture.shape[:2], np.bool_)
    mark_triangles(corners, shown)
    if not shown.all() and shown.any():
        fill_holes(picture, shown)
