"""Compares an episode's image files with the digests of its step rows.

Depth files are lossless, so their pixels must match the digest. Colour files are JPEG, and the digest is of the pixels
before compression: a colour file must be complete and must decode.
"""

import os
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from vsnbench.results.files.confined_paths import LARGEST_FILE_BYTES
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.values.encoding.image_digest import StepDigests, is_digest_of_depth
from vsnbench.values.encoding.images import decode_picture

_ENDS = {".jpg": b"\xff\xd9", ".png": b"IEND\xaeB`\x82"}
"""Last bytes of a complete file."""


class Damage(StrEnum):
    """Kinds of damage of an image file."""

    MISSING = "is missing"
    NOT_A_FILE = "is not a regular file"
    EMPTY = "is empty"
    INCOMPLETE = "is incomplete"
    UNREADABLE = "cannot be read"
    UNDECODABLE = "is not an image"
    OTHER_PIXELS = "does not match its digest"


@dataclass(frozen=True, slots=True)
class ImageFault:
    """A missing or damaged image file."""

    file: Path
    """Relative to the episode's directory."""
    damage: Damage

    def __str__(self) -> str:
        return f"{self.file} {self.damage}"


def image_faults(directory: Path, steps: Sequence[StepDigests], *, decode: bool) -> list[ImageFault]:
    """Return the image files that are missing or damaged.

    Args:
        directory: directory of the episode; it is not trusted, and links in it are not followed.
        steps: digests of the episode's step rows.
        decode: also decode every image and compare depth pixels with their digest (about 5 ms per step at 640 x 480).
            Otherwise only existence, type, size and the last bytes of each file are checked.
    """
    return [
        ImageFault(file, damage)
        for file, depth_digest in _expected(steps)
        if (damage := _damage(directory / file, depth_digest, decode=decode)) is not None
    ]


def _expected(steps: Sequence[StepDigests]) -> Iterator[tuple[Path, str | None]]:
    """Yield each expected file, with the digest for depth images."""
    for step in steps:
        if step.rgb is not None:
            yield rgb_path(Path(), step.number), None
        if step.depth is not None:
            yield depth_path(Path(), step.number), step.depth


def _damage(file: Path, depth_digest: str | None, *, decode: bool) -> Damage | None:
    end = _ENDS[file.suffix]
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except (FileNotFoundError, NotADirectoryError):
        return Damage.MISSING
    except OSError:
        return Damage.NOT_A_FILE if file.is_symlink() else Damage.UNREADABLE
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            return Damage.NOT_A_FILE
        if status.st_size == 0:
            return Damage.EMPTY
        if status.st_size > LARGEST_FILE_BYTES:
            return Damage.UNDECODABLE
        if os.pread(descriptor, len(end), max(status.st_size - len(end), 0)) != end:
            return Damage.INCOMPLETE
        if not decode:
            return None
        with open(descriptor, "rb", closefd=False) as opened:
            return _damage_of_pixels(opened.read(), depth_digest)
    except OSError:
        return Damage.UNREADABLE
    finally:
        os.close(descriptor)


def _damage_of_pixels(content: bytes, depth_digest: str | None) -> Damage | None:
    import cv2

    pixels = decode_picture(content, cv2.IMREAD_COLOR if depth_digest is None else cv2.IMREAD_UNCHANGED)
    if pixels is None:
        return Damage.UNDECODABLE
    if depth_digest is None:
        return None
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        return Damage.OTHER_PIXELS
    return None if is_digest_of_depth(depth_digest, pixels) else Damage.OTHER_PIXELS
