"""Matching, decoding and depth filtering of a robot's image messages.

Matched images were taken after the motion ended, colour and depth close in time. Decoding handles padded rows and
big-endian data; cv_bridge needs numpy 1 and is not used. The depth is the temporal median of the valid measurements of
N images (paper, Section 3.1.4, image preprocessing).
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, Protocol, TypeVar, cast

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ImageError
from vsnbench.sensing.images.compressed_images import (
    CompressedMessage,
    decode_compressed_color,
    decode_compressed_depth,
)

Payload = TypeVar("Payload")
COLOR_ENCODINGS = ("rgb8", "bgr8", "rgba8", "bgra8", "mono8")
DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
LABEL_ENCODINGS = ("16UC1", "32SC1")
Scalar = TypeVar("Scalar", bound=np.generic)
_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}
DepthImage = npt.NDArray[np.uint16] | npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Stamped(Generic[Payload]):
    """A message with its stamp (sender's clock) and arrival (monotonic clock of this process)."""

    payload: Payload
    stamp_s: float
    arrival_s: float


@dataclass(frozen=True, slots=True)
class MotionEnd:
    """End of the last motion on the robot's clock and on that of this process; images must be younger by both."""

    stamp_s: float
    arrival_s: float


@dataclass(frozen=True, slots=True, eq=False)
class MatchedImages(Generic[Payload]):
    """One colour image and the depth images of one median."""

    color: Stamped[Payload]
    depths: tuple[Stamped[Payload], ...]

    @property
    def skew_s(self) -> float:
        """Colour stamp minus newest depth stamp; 0 without depth."""
        return self.color.stamp_s - self.depths[-1].stamp_s if self.depths else 0.0


def frames_after(frames: Sequence[Stamped[Payload]], end: MotionEnd) -> list[Stamped[Payload]]:
    """Return the images that were taken after the motion ended, in their order."""
    return [frame for frame in frames if frame.stamp_s > end.stamp_s and frame.arrival_s > end.arrival_s]


def match_images(
    colors: Sequence[Stamped[Payload]],
    depths: Sequence[Stamped[Payload]],
    end: MotionEnd,
    depth_frames: int,
    max_skew_s: float,
) -> MatchedImages[Payload] | None:
    """Return the newest complete match, or None while images are missing.

    Args:
        colors: latest colour images, oldest first.
        depths: latest depth images, oldest first.
        end: end of the last motion.
        depth_frames: number of depth images per median; 0 for a robot without depth.
        max_skew_s: largest difference of the stamps of colour and newest depth image.
    """
    fresh_colors = frames_after(colors, end)
    if not fresh_colors:
        return None
    if depth_frames == 0:
        return MatchedImages(fresh_colors[-1], ())
    fresh_depths = frames_after(depths, end)[-depth_frames:]
    if len(fresh_depths) < depth_frames:
        return None
    newest_s = fresh_depths[-1].stamp_s
    match = MatchedImages(min(fresh_colors, key=lambda frame: abs(frame.stamp_s - newest_s)), tuple(fresh_depths))
    return match if abs(match.skew_s) <= max_skew_s else None


class ImageMessage(Protocol):
    """The fields read of a sensor_msgs/Image."""

    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: bytes


def decode_color(message: ImageMessage | CompressedMessage) -> npt.NDArray[np.uint8]:
    """Return a colour or grey image as (H, W, 3) uint8 RGB.

    Raises:
        ImageError: the encoding is not in COLOR_ENCODINGS, or the data is too short.
    """
    if not hasattr(message, "encoding"):
        return decode_compressed_color(message)
    message = cast("ImageMessage", message)
    channels = _CHANNELS.get(message.encoding)
    if channels is None:
        raise ImageError(f"a colour image is encoded as {message.encoding!r}, not {', '.join(COLOR_ENCODINGS)}")
    pixels = _rows(message, np.uint8, channels)
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    order = [2, 1, 0] if message.encoding.startswith("bgr") else [0, 1, 2]
    return np.ascontiguousarray(pixels[..., order])


def decode_depth(message: ImageMessage | CompressedMessage) -> npt.NDArray[np.uint16] | npt.NDArray[np.float32]:
    """Return a depth image (H, W): uint16 millimetres (0 invalid) or float32 metres (NaN invalid).

    Raises:
        ImageError: the encoding is not in DEPTH_ENCODINGS, or the data is too short.
    """
    if not hasattr(message, "encoding"):
        return decode_compressed_depth(message)
    message = cast("ImageMessage", message)
    if message.encoding in ("16UC1", "mono16"):
        return _rows(message, np.uint16, 1)[..., 0]
    if message.encoding == "32FC1":
        return _rows(message, np.float32, 1)[..., 0]
    raise ImageError(f"a depth image is encoded as {message.encoding!r}, not {', '.join(DEPTH_ENCODINGS)}")


def decode_labels(message: ImageMessage) -> npt.NDArray[np.int32]:
    """Return a simulator's instance image (H, W) int32.

    Raises:
        ImageError: the encoding is not in LABEL_ENCODINGS, or the data is too short.
    """
    if message.encoding == "16UC1":
        return _rows(message, np.uint16, 1)[..., 0].astype(np.int32)
    if message.encoding == "32SC1":
        return _rows(message, np.int32, 1)[..., 0]
    raise ImageError(f"an instance image is encoded as {message.encoding!r}, not {', '.join(LABEL_ENCODINGS)}")


def _rows(message: ImageMessage, scalar: type[Scalar], channels: int) -> npt.NDArray[Scalar]:
    """Return the pixels (H, W, channels) in native byte order, without padding."""
    dtype = np.dtype(scalar)
    row_bytes = message.width * channels * dtype.itemsize
    if message.width < 1 or message.height < 1 or message.step < row_bytes:
        raise ImageError(
            f"a {message.encoding} image of {message.width}x{message.height} has rows of {message.step} bytes, "
            f"expected at least {row_bytes}"
        )
    # The last row may have no padding.
    if len(message.data) < message.step * (message.height - 1) + row_bytes:
        raise ImageError(
            f"a {message.encoding} image of {message.width}x{message.height} has {len(message.data)} bytes, "
            f"expected {message.step * message.height}"
        )
    flat = np.frombuffer(message.data, np.uint8)
    if message.step == row_bytes:
        rows = flat[: row_bytes * message.height].reshape(message.height, row_bytes)
    else:
        rows = np.lib.stride_tricks.as_strided(flat, (message.height, row_bytes), (message.step, 1), writeable=False)
    pixels = np.ascontiguousarray(rows).view(dtype).reshape(message.height, message.width, channels)
    swapped = bool(message.is_bigendian) != (sys.byteorder == "big")
    return pixels.byteswap() if swapped and dtype.itemsize > 1 else pixels


def median_depth_m(frames: Sequence[DepthImage], min_m: float = 0.0, max_m: float = 100.0) -> npt.NDArray[np.float32]:
    """Return the median of the valid measurements of each pixel.

    Args:
        frames: one or more images (H, W) of the same shape and type: uint16 millimetres with 0 for invalid, or
            float32 metres with NaN, infinity or 0 for invalid.
        min_m: shortest valid measurement.
        max_m: longest valid measurement.

    Returns:
        (H, W) float32 metres; NaN where no frame has a valid measurement. The mean of the middle two for an even
        number.

    Raises:
        ValueError: there are no frames, or they differ in shape or type.
    """
    if not frames:
        raise ValueError("a median needs at least one depth image")
    first = frames[0]
    if any(frame.shape != first.shape or frame.dtype != first.dtype for frame in frames):
        raise ValueError("depth images of one median must have the same size and encoding")
    height, width = first.shape
    stack = np.stack([frame.reshape(-1) for frame in frames])
    out = np.empty(height * width, np.float32)
    if stack.dtype == np.uint16:
        # Limits in the unit of the stack keep the kernel in 16 bits.
        lowest, highest = max(math.ceil(min_m * 1000), 1), min(math.floor(max_m * 1000), 65534)
        _kernel()(stack, np.uint16(lowest), np.uint16(highest), np.uint16(65535), np.float32(1000), out)
    else:
        lowest_m, highest_m = np.float32(max(min_m, 1e-6)), np.float32(min(max_m, 1e6))
        _kernel()(stack, lowest_m, highest_m, np.float32(np.inf), np.float32(1), out)
    return out.reshape(height, width)


def beyond_range(frame: DepthImage, depth_m: npt.NDArray[np.float32], max_m: float) -> npt.NDArray[np.bool_]:
    """Return the invalid pixels of a depth image that were measured beyond `max_m`.

    Args:
        frame: raw depth image (H, W); infinity means beyond the range, as in REP 117.
        depth_m: filtered image (H, W), metres, NaN where invalid.
        max_m: longest valid measurement.
    """
    if frame.dtype == np.uint16:
        far = (frame > math.floor(max_m * 1000)) & (frame < 65535)
    else:
        far = frame > np.float32(max_m)
    found: npt.NDArray[np.bool_] = far & np.isnan(depth_m)
    return found


def share_invalid(depth_m: npt.NDArray[np.float32]) -> float:
    """Return the share of pixels without a measurement, 0 to 1."""
    return float(np.count_nonzero(np.isnan(depth_m)) / depth_m.size)


@cache
def _kernel() -> Callable[..., Any]:
    """Return the median kernel; imports numba and compiles on first use."""
    from vsnbench.runtime.numba_cache import compiled

    return compiled(_median_of_valid)


def _median_of_valid(
    stack: Any, lowest: Any, highest: Any, invalid: Any, units_per_metre: np.float32, out: npt.NDArray[np.float32]
) -> None:
    """Fill `out` with the median in metres of the valid values in each column of `stack` (frames, pixels).

    Invalid values become `invalid`, the largest number. A network of compare-exchanges sorts the columns. Each exchange
    runs over a row of pixels, for which the compiler emits vector instructions.
    """
    frames, pixels = stack.shape
    block = 4096
    values = np.empty((frames, block), stack.dtype)
    counts = np.empty(block, np.int32)
    for begin in range(0, pixels, block):
        size = min(block, pixels - begin)
        counts[:] = 0
        for frame in range(frames):
            row = values[frame]
            for pixel in range(size):
                value = stack[frame, begin + pixel]
                valid = value >= lowest and value <= highest
                row[pixel] = value if valid else invalid
                counts[pixel] += 1 if valid else 0
        for rounds in range(frames):
            for upper in range(1 + rounds % 2, frames, 2):
                low, high = values[upper - 1], values[upper]
                for pixel in range(size):
                    a, b = low[pixel], high[pixel]
                    low[pixel] = a if a < b else b
                    high[pixel] = b if a < b else a
        for pixel in range(size):
            count = counts[pixel]
            if count == 0:
                out[begin + pixel] = np.nan
            else:
                middle = np.float32(values[count // 2, pixel])
                other = np.float32(values[(count - 1) // 2, pixel])
                out[begin + pixel] = (middle + other) / (np.float32(2) * units_per_metre)
