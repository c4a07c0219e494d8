"""From the image messages of a robot to the images of one observation: matched, decoded, the depth filtered.

Matched: all taken after the motion ended, colour and depth close in time. Decoded: sensor_msgs/Image to numpy, padded
rows and big-endian too; cv_bridge is compiled against numpy 1, so the few encodings that a depth camera sends are
decoded here. Filtered: the temporal median over N depth images (paper, Section 3.1.4, image preprocessing), invalid
pixels left out.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RobotError

Payload = TypeVar("Payload")
COLOR_ENCODINGS = ("rgb8", "bgr8", "rgba8", "bgra8", "mono8")
DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
LABEL_ENCODINGS = ("16UC1", "32SC1")
Scalar = TypeVar("Scalar", bound=np.generic)
_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}
DepthImage = npt.NDArray[np.uint16] | npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Stamped(Generic[Payload]):
    """A message, when it was taken (sender's clock) and when it arrived (our monotonic clock)."""

    payload: Payload
    stamp_s: float
    arrival_s: float


@dataclass(frozen=True, slots=True)
class MotionEnd:
    """When the last motion was over, on the robot's clock and on ours; images must be younger by both."""

    stamp_s: float
    arrival_s: float


@dataclass(frozen=True, slots=True, eq=False)
class MatchedImages(Generic[Payload]):
    """One colour image, and the depth images that one depth is filtered from."""

    color: Stamped[Payload]
    depths: tuple[Stamped[Payload], ...]

    @property
    def skew_s(self) -> float:
        """Colour stamp minus the newest depth stamp; 0 without depth."""
        return self.color.stamp_s - self.depths[-1].stamp_s if self.depths else 0.0


def frames_after(frames: Sequence[Stamped[Payload]], end: MotionEnd) -> list[Stamped[Payload]]:
    """Return the frames that were taken after the motion ended, in the order in which they came."""
    return [frame for frame in frames if frame.stamp_s > end.stamp_s and frame.arrival_s > end.arrival_s]


def match_images(
    colors: Sequence[Stamped[Payload]],
    depths: Sequence[Stamped[Payload]],
    end: MotionEnd,
    depth_frames: int,
    max_skew_s: float,
) -> MatchedImages[Payload] | None:
    """Return the newest complete match, or None while images are still missing.

    Args:
        colors: the last colour images, oldest first.
        depths: the last depth images, oldest first.
        end: when the last motion ended.
        depth_frames: how many depth images one observation needs; 0 for a robot without depth.
        max_skew_s: the colour image must be this close to the newest depth image.
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


def median_depth_m(frames: Sequence[DepthImage], min_m: float = 0.0, max_m: float = 100.0) -> npt.NDArray[np.float32]:
    """Return the median of the valid measurements of each pixel.

    Args:
        frames: one or more images (H, W) of the same shape and type: uint16 millimetres with 0 for invalid, or
            float32 metres with NaN, infinity or 0 for invalid.
        min_m: nearer measurements are invalid.
        max_m: farther measurements are invalid.

    Returns:
        (H, W) float32 metres; NaN where no frame has a valid measurement. The mean of the middle two where their
        number is even.

    Raises:
        ValueError: no frames, or frames that differ in shape or type.
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
        # Ranges in the stack's own unit, so that the kernel never leaves 16 bits.
        lowest, highest = max(math.ceil(min_m * 1000), 1), min(math.floor(max_m * 1000), 65534)
        _kernel()(stack, np.uint16(lowest), np.uint16(highest), np.uint16(65535), np.float32(1000), out)
    else:
        lowest_m, highest_m = np.float32(max(min_m, 1e-6)), np.float32(min(max_m, 1e6))
        _kernel()(stack, lowest_m, highest_m, np.float32(np.inf), np.float32(1), out)
    return out.reshape(height, width)


def share_invalid(depth_m: npt.NDArray[np.float32]) -> float:
    """Return the share of pixels with no measurement, 0 to 1."""
    return float(np.count_nonzero(np.isnan(depth_m)) / depth_m.size)


@cache
def _kernel() -> Callable[..., Any]:
    """Return the compiled median; compiled on first use, and numba is imported only then."""
    from vsnbench.compilation import compiled

    return compiled(_median_of_valid)


def _median_of_valid(
    stack: Any, lowest: Any, highest: Any, invalid: Any, units_per_metre: np.float32, out: npt.NDArray[np.float32]
) -> None:
    """Fill `out` with the median in metres of the valid values in each column of `stack` (frames, pixels).

    Invalid values become `invalid`, the largest number, and the columns are sorted by a network of compare-exchanges:
    each of them runs over a row of pixels, which the compiler turns into vector instructions.
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
