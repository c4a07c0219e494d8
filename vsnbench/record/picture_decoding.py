"""Decodes pictures of unknown origin: PNG or JPEG of a bounded size, judged before anything is unpacked."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

MOST_PIXELS: Final = 4096 * 4096
"""Far above any robot's camera; 48 MiB of colour."""
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"
_JPEG_FRAMES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
_JPEG_ALONE = frozenset({0x01, *range(0xD0, 0xD9)})
"""Markers without a length."""


def decode_picture(content: bytes, flags: int) -> npt.NDArray[Any] | None:
    """Return a picture's pixels, (H, W) or (H, W, 3) BGR; None when it is no picture, damaged, or too large.

    Args:
        content: a whole file.
        flags: OpenCV's, such as `cv2.IMREAD_COLOR`.
    """
    import cv2

    size = picture_size(content)
    if size is None or not 0 < size[0] * size[1] <= MOST_PIXELS:
        return None
    try:
        pixels = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:
        return None
    return None if pixels is None else np.asarray(pixels)


def picture_size(content: bytes) -> tuple[int, int] | None:
    """Return width and height in pixels as a PNG's or JPEG's header has them; None when it is neither."""
    if content.startswith(_PNG):
        return (_number(content, 16, 4), _number(content, 20, 4)) if content[12:16] == b"IHDR" else None
    if not content.startswith(_JPEG):
        return None
    at = 2
    while at + 4 <= len(content):
        if content[at] != 0xFF:
            return None
        marker = content[at + 1]
        if marker == 0xFF:  # padding
            at += 1
        elif marker in _JPEG_ALONE:
            at += 2
        elif marker in _JPEG_FRAMES:
            return _number(content, at + 7, 2), _number(content, at + 5, 2)
        else:
            at += 2 + max(_number(content, at + 2, 2), 2)
    return None


def _number(content: bytes, at: int, width: int) -> int:
    return int.from_bytes(content[at : at + width], "big")
