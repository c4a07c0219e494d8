"""Images between the answers of a robot that drives on: their files, and what the record has of them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from vsnbench.values.decision_check import SENSING
from vsnbench.values.pose import Pose

FILM: Final = "film"
"""Key in the `sensing` of a step's details, and folder of the files."""


@dataclass(frozen=True, slots=True)
class StampedPose:
    """A pose with its time on the robot's clock, seconds."""

    stamp_s: float
    pose: Pose


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """An image that was taken while the robot drove."""

    moment: StampedPose
    """Its time, and the robot's pose in the site."""
    file_digest: str
    """Digest of the bytes of its file."""
    rgb_jpeg: bytes | None = None
    """Content of the file, for viewers; None if it is missing."""
    commanded: tuple[float, float, float] | None = None
    """Velocity that a stack commanded then: ahead and to the left in m/s, turn in rad/s; None if it is not known."""


def film_path(directory: Path, number: int, frame: int) -> Path:
    """Return the path of an image after the answer of a step; both count from 1."""
    return directory.joinpath(FILM, f"{number:04d}-{frame:03d}.jpg")


def film_to_json(film: Sequence[RecordedFrame]) -> list[list[Any]]:
    """Return what the record has of images: [stamp_s, x_m, y_m, heading_rad, digest of the file] each.

    Where a stack drives, the velocity that it commanded follows: linear_m_s, lateral_m_s, angular_rad_s.
    """
    rows = ((frame.moment, frame.file_digest, frame.commanded or ()) for frame in film)
    return [[at.stamp_s, at.pose.x_m, at.pose.y_m, at.pose.heading_rad, digest, *sent] for at, digest, sent in rows]


def film_of(details: object) -> tuple[RecordedFrame, ...]:
    """Return the images of a step with these details, without their files; none if they cannot be read."""
    sensing = details.get(SENSING) if isinstance(details, Mapping) else None
    rows = sensing.get(FILM) if isinstance(sensing, Mapping) else None
    try:
        return tuple(
            RecordedFrame(
                StampedPose(_finite(stamp_s), Pose(_finite(x_m), _finite(y_m), _finite(heading_rad))),
                str(digest),
                commanded=(_finite(sent[0]), _finite(sent[1]), _finite(sent[2])) if sent else None,
            )
            for stamp_s, x_m, y_m, heading_rad, digest, *sent in rows or ()
        )
    except (TypeError, ValueError, IndexError):
        return ()


def _finite(value: Any) -> float:
    """Return a number of the record.

    Raises:
        ValueError: it is not a finite one.
    """
    if not math.isfinite(number := float(value)):
        raise ValueError(f"{value} is not finite")
    return number
