"""Draws text and pictures into a video frame; every position and size is in pixels."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Rgb = tuple[int, int, int]
Image = npt.NDArray[np.uint8]
"""RGB, (H, W, 3)."""

PAPER: Rgb = (250, 250, 248)
INK: Rgb = (32, 34, 38)
FAINT: Rgb = (110, 112, 118)


@dataclass(frozen=True, slots=True)
class Area:
    """A rectangle of a frame."""

    left: int
    top: int
    width: int
    height: int

    def inset(self, margin: int) -> "Area":
        """Return the area without a margin on all sides."""
        return Area(self.left + margin, self.top + margin, self.width - 2 * margin, self.height - 2 * margin)


class FrameCanvas:
    """One frame of a video."""

    def __init__(self, width: int, height: int, background: Rgb = PAPER) -> None:
        from PIL import Image as PillowImage
        from PIL import ImageDraw

        self._picture = PillowImage.new("RGB", (width, height), background)
        self._draw = ImageDraw.Draw(self._picture)

    def fill(self, area: Area, rgb: Rgb) -> None:
        """Fill a rectangle."""
        right, bottom = area.left + area.width - 1, area.top + area.height - 1
        self._draw.rectangle((area.left, area.top, right, bottom), fill=rgb)

    def line(self, points: Sequence[tuple[float, float]], rgb: Rgb, width: int) -> None:
        """Draw a line through points (x, y); nothing through fewer than two."""
        if len(points) > 1:
            self._draw.line(points, fill=rgb, width=width, joint="curve")

    def paste(self, picture: Image, area: Area) -> None:
        """Paste an image in the middle of an area, as large as it fits."""
        from PIL import Image as PillowImage

        shown = fitted(picture, area.width, area.height)
        left = area.left + (area.width - shown.shape[1]) // 2
        top = area.top + (area.height - shown.shape[0]) // 2
        self._picture.paste(PillowImage.fromarray(shown), (left, top))

    def write(self, text: str, area: Area, size: int, rgb: Rgb = INK, *, bold: bool = False) -> None:
        """Write one line at the left of an area, shortened to its width."""
        font = _font(size, bold)
        words = sanitize(text)
        if font.getlength(words) > area.width:
            while words and font.getlength(words + "…") > area.width:
                words = words[:-1]
            words += "…"
        self._draw.text((area.left, area.top + area.height / 2), words, font=font, fill=rgb, anchor="lm")

    def pixels(self) -> Image:
        """Return the frame, (H, W, 3)."""
        return np.asarray(self._picture)


def fitted(picture: Image, width: int, height: int) -> Image:
    """Return an image scaled to fit, with its proportions."""
    import cv2

    scale = min(width / picture.shape[1], height / picture.shape[0])
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(picture, size, interpolation=how), np.uint8)


@cache
def _font(size: int, bold: bool) -> "FreeTypeFont":
    import matplotlib as mpl
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(mpl.get_data_path(), "fonts", "ttf", name)), size)
