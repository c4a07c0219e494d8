"""Writes frames to an MP4 file with H.264, which browsers, slides and players open."""

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
import numpy.typing as npt

from vsnbench.errors import UsageError
from vsnbench.files.atomic import atomic_file
from vsnbench.installation import command_to_add, command_to_install

if TYPE_CHECKING:
    from av import VideoStream

_CODEC = "libx264"
CODEC_NAME = "h264"
"""Name of the codec for readers."""


@dataclass(frozen=True, slots=True)
class Mp4Encoding:
    """Quality and structure of a video."""

    crf: int = 23
    """Constant rate factor: 0 is lossless, 51 the worst."""
    preset: str = "veryfast"
    keyframe_interval: int | None = None
    """Frames from one keyframe to the next, without frames that depend on later ones; None: the codec decides."""

    @property
    def options(self) -> dict[str, str]:
        """Options of the encoder."""
        options = {"crf": str(self.crf), "preset": self.preset}
        if self.keyframe_interval is not None:
            options |= {"g": str(self.keyframe_interval), "bf": "0"}
        return options


_FOR_VIEWERS = Mp4Encoding()


def pixel_format(width: int, height: int) -> str:
    """Return the format of the pixels of a video; colours at half the resolution need even sides."""
    return "yuv444p" if width % 2 or height % 2 else "yuv420p"


def write_mp4(
    frames: Iterable[npt.NDArray[np.uint8]], path: Path, frames_per_s: float, encoding: Mp4Encoding = _FOR_VIEWERS
) -> int:
    """Write a video and return its number of frames.

    Args:
        frames: images of equal size, (H, W, 3) RGB.
        path: the file; it appears when it is complete.
        frames_per_s: speed.
        encoding: quality and structure.

    Raises:
        UsageError: the library or the codec is missing.
        RecordError: the file cannot be written.
    """
    try:
        import av
        from av.codec.codec import UnknownCodecError
    except ImportError as error:
        raise UsageError("videos require the library PyAV", advice=command_to_add("video")) from error
    rate, written = Fraction(frames_per_s).limit_denominator(1000), 0
    with atomic_file(path) as part, av.open(str(part), "w", format="mp4", options={"movflags": "faststart"}) as file:
        try:
            stream = cast("VideoStream", file.add_stream(_CODEC, rate=rate, options=encoding.options))
        except UnknownCodecError as error:
            raise UsageError(
                f"this build of PyAV has no encoder {_CODEC}",
                advice=f"install PyAV from PyPI: {command_to_install('av', '--force-reinstall')}",
                code="missing-codec",
            ) from error
        for frame in frames:
            if not written:
                stream.height, stream.width = frame.shape[:2]
                stream.pix_fmt = pixel_format(stream.width, stream.height)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
            written += 1
        file.mux(stream.encode())
    return written
