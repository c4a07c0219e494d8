"""Compares an episode's image files with the digests of its step rows.

The digest of a file finds every changed byte. Steps from before schema 0009 have none: then the pixels of a depth file,
which is lossless, must match their digest, and a colour file must be complete and decode. Hashing a file takes a tenth
of the time of decoding it.
"""

import os
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from vsnbench.results.files.confined_paths import LARGEST_FILE_BYTES
from vsnbench.results.files.film import film_path
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.values.encoding.image_digest import StepDigests, file_digest, is_digest_of_depth
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
    OTHER_BYTES = "does not have the bytes that were written"
    OTHER_PIXELS = "does not match its digest"


@dataclass(frozen=True, slots=True)
class ImageFault:
    """A missing or damaged image file."""

    file: Path
    """Relative to the episode's directory."""
    damage: Damage

    def __str__(self) -> str:
        return f"{self.file} {self.damage}"


def image_faults(
    directory: Path, steps: Sequence[StepDigests], *, read: bool, decode: bool = False
) -> list[ImageFault]:
    """Return the image files that are missing or damaged.

    Args:
        directory: directory of the episode; it is not trusted, and links in it are not followed.
        steps: digests of the episode's step rows.
        read: also read every file and compare it with the digest of its bytes, or decode it where the step has none.
            Otherwise only existence, type, size and the last bytes of each file are checked.
        decode: decode the other files as well, and compare depth with the digest of its pixels (about 5 ms per step at
            640 x 480): the row of a step may contradict its files.
    """
    return [
        ImageFault(image.file, damage)
        for image in expected_images(steps)
        if (damage := _damage(directory / image.file, image, read=read, decode=decode)) is not None
    ]


@dataclass(frozen=True, slots=True)
class ExpectedImage:
    """An image file that a step row describes."""

    file: Path
    """Relative to the episode's directory."""
    depth_digest: str | None
    """Digest of the pixels of a depth file; None for a colour file."""
    file_digest: str | None
    """Digest of the bytes; None for steps from before schema 0009."""


def expected_images(steps: Sequence[StepDigests]) -> Iterator[ExpectedImage]:
    """Yield the image files of an episode's steps."""
    for step in steps:
        for role, seen in (("", step), *step.cameras):
            if seen.rgb is not None:
                yield ExpectedImage(rgb_path(Path(), step.number, role), None, seen.rgb_file)
            if seen.depth is not None:
                yield ExpectedImage(depth_path(Path(), step.number, role), seen.depth, seen.depth_file)
        for place, digest in enumerate(step.film, start=1):
            yield ExpectedImage(film_path(Path(), step.number, place), None, digest)


def _damage(file: Path, image: ExpectedImage, *, read: bool, decode: bool) -> Damage | None:
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
        if not read:
            return None
        with open(descriptor, "rb", closefd=False) as opened:
            return _damage_of_content(opened.read(), image, decode=decode)
    except OSError:
        return Damage.UNREADABLE
    finally:
        os.close(descriptor)


def _damage_of_content(content: bytes, image: ExpectedImage, *, decode: bool) -> Damage | None:
    if image.file_digest is not None:
        if file_digest(content) != image.file_digest:
            return Damage.OTHER_BYTES
        if not decode:
            return None
    import cv2

    depth_digest = image.depth_digest
    pixels = decode_picture(content, cv2.IMREAD_COLOR if depth_digest is None else cv2.IMREAD_UNCHANGED)
    if pixels is None:
        return Damage.UNDECODABLE
    if depth_digest is None:
        return None
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        return Damage.OTHER_PIXELS
    return None if is_digest_of_depth(depth_digest, pixels) else Damage.OTHER_PIXELS
