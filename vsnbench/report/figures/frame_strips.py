"""Frame strips: five images of an episode, as in the paper's Figures 6 and 7."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vsnbench.errors import RecordError
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.values.encoding.images import decode_picture

FRAMES = 5
_WIDTH_PX = 176


@dataclass(frozen=True, slots=True)
class FrameStrip:
    """A JPEG of frames in a row."""

    jpeg: bytes
    frames: int


def frame_strip(results_directory: Path, images_directory: str) -> FrameStrip | None:
    """Return five frames from the first to the last in a row; None without readable images.

    Args:
        results_directory: only files below it are read, whatever the database contains.
        images_directory: the episode's directory, relative to it.
    """
    if not images_directory:
        return None
    try:
        directory = confined(results_directory, Path(images_directory) / "rgb")
    except RecordError:
        return None
    if not directory.is_dir():
        return None
    files = sorted(path for path in directory.iterdir() if path.suffix.lower() in (".jpg", ".jpeg", ".png"))
    if not files:
        return None
    frames = []
    for place in np.unique(np.linspace(0, len(files) - 1, FRAMES).round().astype(int)):
        picture = _picture(directory, files[place].name)
        if picture is None:
            continue  # truncated by a crash; the other frames are sufficient
        height = round(_WIDTH_PX * picture.shape[0] / picture.shape[1])
        frames.append(cv2.resize(picture, (_WIDTH_PX, height), interpolation=cv2.INTER_AREA))
    frames = [frame for frame in frames if frame.shape == frames[0].shape]
    if not frames:
        return None
    gap = np.full((frames[0].shape[0], 4, 3), 255, np.uint8)
    row = [piece for frame in frames for piece in (frame, gap)][:-1]
    written, jpeg = cv2.imencode(".jpg", np.concatenate(row, axis=1), [cv2.IMWRITE_JPEG_QUALITY, 72])
    return FrameStrip(jpeg.tobytes(), len(frames)) if written else None


def _picture(directory: Path, name: str) -> npt.NDArray[np.uint8] | None:
    try:
        content = read_confined(directory, name)
    except RecordError:
        return None
    # JPEG decodes directly to a quarter of the size, which is sufficient.
    return decode_picture(content, cv2.IMREAD_REDUCED_COLOR_4) if content else None
