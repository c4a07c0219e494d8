"""Digests of images and their comparison.

A digest is text, `ALGORITHM:hex`. A digest of pixels does not depend on an encoder, so that two runs can be compared; a
digest of a file's bytes finds every change of the file. New digests use BLAKE3, which takes at most a quarter of the
time of SHA-256; records from before schema 0005 have SHA-256 of the same pixels.
"""

import hashlib
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from blake3 import blake3

ALGORITHM: Final = "blake3"
"""Algorithm of new digests."""
_OLDER_ALGORITHM: Final = "sha256"


class Pixels(StrEnum):
    """Result of a comparison of two digests."""

    SAME = "same"
    OTHER = "other"
    NOT_COMPARABLE = "not comparable"
    """The digests have different algorithms, so that they differ for equal images too."""


@dataclass(frozen=True, slots=True)
class StepDigests:
    """Digests of the images of one step; None without an image or a known digest."""

    number: int
    """Step number, from 1."""
    rgb: str | None
    depth: str | None
    rgb_file: str | None = None
    """Digest of the bytes of the colour file; None without a file and in records from before schema 0009."""
    depth_file: str | None = None
    film: tuple[str, ...] = ()
    """Digests of the files of the images that were taken until the next answer took effect."""
    cameras: "tuple[tuple[str, StepDigests], ...]" = ()
    """Role of each further camera, with the digests of its images."""


def rgb_digest(rgb: npt.NDArray[np.uint8]) -> str:
    """Return the digest of a colour image: of its (H, W, 3) bytes, row by row, red first."""
    return _digest(np.ascontiguousarray(rgb))


def depth_digest(millimetres: npt.NDArray[np.uint16]) -> str:
    """Return the digest of a depth image (H, W) in millimetres: of its numbers, row by row, low byte first."""
    return _digest(np.ascontiguousarray(millimetres, "<u2"))


def file_digest(content: bytes) -> str:
    """Return the digest of a file's bytes."""
    return f"{ALGORITHM}:{blake3(content).hexdigest()}"


def is_digest_of_depth(digest: str, millimetres: npt.NDArray[np.uint16]) -> bool:
    """Return whether a digest of either algorithm belongs to a depth image (H, W) in millimetres."""
    if algorithm(digest) == ALGORITHM:
        return digest == depth_digest(millimetres)
    content = np.ascontiguousarray(millimetres, "<u2").tobytes()
    return digest == f"{_OLDER_ALGORITHM}:{hashlib.sha256(content).hexdigest()}"


def compare_digests(digest: str | None, other: str | None) -> Pixels:
    """Compare the pixels of two digests; None is the digest of an image that was not rendered."""
    if digest == other:
        return Pixels.SAME
    if digest is None or other is None or algorithm(digest) == algorithm(other):
        return Pixels.OTHER
    return Pixels.NOT_COMPARABLE


def algorithm(digest: str) -> str:
    """Return the algorithm of a digest."""
    return digest.partition(":")[0]


def _digest(pixels: npt.NDArray[Any]) -> str:
    return f"{ALGORITHM}:{blake3(pixels.reshape(-1).view(np.uint8).data).hexdigest()}"
