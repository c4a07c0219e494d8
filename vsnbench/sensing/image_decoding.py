"""sensor_msgs/Image to numpy: colour to RGB, depth to millimetres or metres; padded rows and big-endian too.

cv_bridge is compiled against numpy 1, so the few encodings that a depth camera sends are decoded here.
"""

import sys
from typing import Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RobotError

COLOR_ENCODINGS = ("rgb8", "bgr8", "rgba8", "bgra8", "mono8")
DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
LABEL_ENCODINGS = ("16UC1", "32SC1")
Scalar = TypeVar("Scalar", bound=np.generic)
_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}


class ImageError(RobotError):
    """An image message that cannot be decoded."""


class ImageMessage(Protocol):
    """What we read of a sensor_msgs/Image."""

    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: bytes


def decode_color(message: ImageMessage) -> npt.NDArray[np.uint8]:
    """Return a colour or grey image as (H, W, 3) uint8 RGB.

    Raises:
        ImageError: the encoding is none of COLOR_ENCODINGS, or the sizes do not fit together.
    """
    channels = _CHANNELS.get(message.encoding)
    if channels is None:
        raise ImageError(f"a colour image is encoded as {message.encoding!r}, not {', '.join(COLOR_ENCODINGS)}")
    pixels = _rows(message, np.uint8, channels)
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    order = [2, 1, 0] if message.encoding.startswith("bgr") else [0, 1, 2]
    return np.ascontiguousarray(pixels[..., order])


def decode_depth(message: ImageMessage) -> npt.NDArray[np.uint16] | npt.NDArray[np.float32]:
    """Return a depth image (H, W) as it was sent: uint16 millimetres (0 invalid) or float32 metres (NaN invalid).

    Raises:
        ImageError: the encoding is none of DEPTH_ENCODINGS, or the sizes do not fit together.
    """
    if message.encoding in ("16UC1", "mono16"):
        return _rows(message, np.uint16, 1)[..., 0]
    if message.encoding == "32FC1":
        return _rows(message, np.float32, 1)[..., 0]
    raise ImageError(f"a depth image is encoded as {message.encoding!r}, not {', '.join(DEPTH_ENCODINGS)}")


def decode_labels(message: ImageMessage) -> npt.NDArray[np.int32]:
    """Return a simulator's instance image (H, W) int32.

    Raises:
        ImageError: the encoding is none of LABEL_ENCODINGS, or the sizes do not fit together.
    """
    if message.encoding == "16UC1":
        return _rows(message, np.uint16, 1)[..., 0].astype(np.int32)
    if message.encoding == "32SC1":
        return _rows(message, np.int32, 1)[..., 0]
    raise ImageError(f"an instance image is encoded as {message.encoding!r}, not {', '.join(LABEL_ENCODINGS)}")


def _rows(message: ImageMessage, scalar: type[Scalar], channels: int) -> npt.NDArray[Scalar]:
    """Return the pixels (H, W, channels) in this machine's byte order, padding cut off."""
    dtype = np.dtype(scalar)
    row_bytes = message.width * channels * dtype.itemsize
    if message.width < 1 or message.height < 1 or message.step < row_bytes:
        raise ImageError(
            f"a {message.encoding} image of {message.width}x{message.height} has rows of {message.step} bytes, "
            f"not {row_bytes} or more"
        )
    # The last row may come without its padding.
    if len(message.data) < message.step * (message.height - 1) + row_bytes:
        raise ImageError(
            f"a {message.encoding} image of {message.width}x{message.height} has {len(message.data)} bytes, "
            f"not {message.step * message.height}"
        )
    flat = np.frombuffer(message.data, np.uint8)
    if message.step == row_bytes:
        rows = flat[: row_bytes * message.height].reshape(message.height, row_bytes)
    else:
        rows = np.lib.stride_tricks.as_strided(flat, (message.height, row_bytes), (message.step, 1), writeable=False)
    pixels = np.ascontiguousarray(rows).view(dtype).reshape(message.height, message.width, channels)
    foreign = bool(message.is_bigendian) != (sys.byteorder == "big")
    return pixels.byteswap() if foreign and dtype.itemsize > 1 else pixels
