"""Decoding of sensor_msgs/CompressedImage: JPEG or PNG for colour, compressedDepth for depth.

compressedDepth (image_transport_plugins, compressed_depth_image_transport/compression_common.h) is a header of 12 bytes
followed by a 16-bit PNG: an int32 format and two float32 parameters A and B. With encoding 16UC1 the PNG holds the
millimetres. With 32FC1 it holds the inverse depth, depth = A / (value - B), and 0 where invalid.
"""

import struct
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ImageError
from vsnbench.values.encoding.images import decode_picture

COMPRESSED, COMPRESSED_DEPTH = "compressed", "compressedDepth"
_HEADER = struct.Struct("<iff")
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"


class CompressedMessage(Protocol):
    """The fields read of a sensor_msgs/CompressedImage."""

    format: str
    data: bytes


def is_compressed(topic: str) -> bool:
    """Return whether a topic carries sensor_msgs/CompressedImage, by image_transport's naming."""
    return topic.rpartition("/")[2] in (COMPRESSED, COMPRESSED_DEPTH)


def decode_compressed_color(message: CompressedMessage) -> npt.NDArray[np.uint8]:
    """Return a compressed colour or grey image as (H, W, 3) uint8 RGB.

    Raises:
        ImageError: the image is neither JPEG nor PNG, or is damaged.
    """
    import cv2

    data = bytes(message.data)
    if not data.startswith((_JPEG, _PNG)):
        raise _other_codec("colour", message.format, "JPEG or PNG")
    pixels = _decoded(data, cv2.IMREAD_COLOR, "colour", message.format)
    if pixels.dtype != np.uint8:
        raise _other_codec("colour", message.format, "8-bit JPEG or PNG")
    # The publisher passes its array to the codec as if it were BGR; the format names the real order.
    encoded_as_rgb = message.format.rpartition("compressed ")[2].strip().startswith("rgb")
    return np.ascontiguousarray(pixels if encoded_as_rgb else pixels[..., ::-1])


def decode_compressed_depth(message: CompressedMessage) -> npt.NDArray[np.uint16] | npt.NDArray[np.float32]:
    """Return a compressed depth image (H, W): uint16 millimetres (0 invalid) or float32 metres (NaN invalid).

    Raises:
        ImageError: the image is not a 16-bit PNG, or is damaged.
    """
    import cv2

    data, formats = bytes(message.data), message.format.replace(";", " ").split()
    encoding = formats[0] if formats else "16UC1"
    has_header = COMPRESSED_DEPTH in formats
    body = data[_HEADER.size :] if has_header else data
    known = encoding in ("16UC1", "mono16") or (encoding == "32FC1" and has_header)
    if not known or not body.startswith(_PNG):
        raise _other_codec("depth", message.format, "16UC1 or 32FC1 as PNG (compressedDepth, format png)")
    values: npt.NDArray[np.uint16] = _decoded(body, cv2.IMREAD_UNCHANGED, "depth", message.format)
    if values.ndim != 2 or values.dtype != np.uint16:
        raise _other_codec("depth", message.format, "a 16-bit PNG of one channel")
    if encoding != "32FC1":
        return values
    _, a, b = _HEADER.unpack_from(data)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth_m = np.float32(a) / (values.astype(np.float32) - np.float32(b))
    depth_m[(values == 0) | ~np.isfinite(depth_m) | (depth_m < 0)] = np.nan
    return depth_m


def _decoded(data: bytes, flags: int, what: str, codec: str) -> Any:
    pixels = decode_picture(data, flags)
    if pixels is None:
        raise ImageError(f"a compressed {what} image ({codec!r}, {len(data)} bytes) cannot be decoded")
    return pixels


def _other_codec(what: str, codec: str, wanted: str) -> ImageError:
    return ImageError(
        f"a compressed {what} image has the format {codec!r}, not {wanted}",
        advice="set the image_transport format in the driver, or use its uncompressed topic in the profile",
    )
