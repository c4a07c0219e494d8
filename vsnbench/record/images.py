"""Writes what the robot saw: one JPEG and one 16-bit PNG a step, and the trajectory, each whole or not at all.

A step's row is committed after its images are in place: a killed process leaves no committed step without them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsnbench.errors import RecordError
from vsnbench.protocol.image_digest import depth_digest, rgb_digest
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.pictures import depth_millimetres, encode_depth_png, encode_jpeg
from vsnbench.protocol.pose import Pose
from vsnbench.record.arrivals import clear_unfinished
from vsnbench.whole_files import write_whole


@dataclass(frozen=True, slots=True)
class WrittenImages:
    """The images of one look, on disk, and the digests of their pixels."""

    rgb_digest: str | None
    """As the policy saw it; None where nobody looks at it, so that it was not drawn."""
    depth_digest: str | None
    """Of the millimetres as the PNG holds them; None without depth."""
    rgb_jpeg: bytes | None
    """What the file holds, for whoever wants to show it; None where there is no file."""
    depth_png: bytes | None


def hash_images(observation: Observation) -> WrittenImages:
    """Return the digests of an observation's images, of which nothing else is kept."""
    seen = rgb_digest(observation.rgb) if Sensor.RGB in observation.sensors else None
    measured = None if observation.depth_m is None else depth_digest(depth_millimetres(observation.depth_m))
    return WrittenImages(seen, measured, None, None)


@dataclass(frozen=True, slots=True)
class StampedPose:
    """A pose and when the robot was there, in seconds on its clock."""

    stamp_s: float
    pose: Pose


def rgb_path(directory: Path, number: int) -> Path:
    """Return where the colour image of a step lies, steps counted from 1."""
    return directory.joinpath("rgb", f"{number:04d}.jpg")


def depth_path(directory: Path, number: int) -> Path:
    """Return where the depth image of a step lies."""
    return directory.joinpath("depth", f"{number:04d}.png")


class EpisodeImages:
    """The image files of one episode. Encoding takes some 3 ms a look: call it off the control path."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        encode_depth_png(depth_millimetres(np.zeros((1, 1), np.float32)))  # compiled now, not while a robot drives
        clear_unfinished(directory)
        try:
            for folder in ("rgb", "depth"):
                (directory / folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _cannot_write(directory, error) from error

    def write(self, number: int, observation: Observation) -> WrittenImages:
        """Write the images of a step; they are in place when this returns.

        Args:
            number: the step, from 1.
            observation: its rgb and depth are written.

        Raises:
            RecordError: they cannot be written.
        """
        # One image after the other: what has just been looked through is still near the core.
        seen, jpeg = rgb_digest(observation.rgb), encode_jpeg(observation.rgb)
        write_whole(rgb_path(self._directory, number), jpeg)
        if observation.depth_m is None:
            return WrittenImages(seen, None, jpeg, None)
        millimetres = depth_millimetres(observation.depth_m)
        measured, png = depth_digest(millimetres), encode_depth_png(millimetres)
        write_whole(depth_path(self._directory, number), png)
        return WrittenImages(seen, measured, jpeg, png)

    def finish(self, path: Sequence[StampedPose] = ()) -> None:
        """Write the trajectory beside the images, where there is one; nothing comes after this.

        Raises:
            RecordError: it cannot be written.
        """
        if path:
            write_trajectory(self._directory / "trajectory.tum", path)


def write_trajectory(path: Path, poses: Iterable[StampedPose]) -> None:
    """Write `timestamp tx ty tz qx qy qz qw` lines, the TUM format that evo and others read.

    Raises:
        RecordError: it cannot be written.
    """
    lines = ["# timestamp tx ty tz qx qy qz qw\n"]
    for moment in poses:
        half = moment.pose.heading_rad / 2
        lines.append(
            f"{moment.stamp_s:.6f} {moment.pose.x_m:.6f} {moment.pose.y_m:.6f} 0 "
            f"0 0 {np.sin(half):.9f} {np.cos(half):.9f}\n"
        )
    write_whole(path, "".join(lines).encode())


def _cannot_write(path: Path, error: OSError) -> RecordError:
    return RecordError(
        f"cannot write {path}: {error.strerror or error}", advice="free some space or look at the permissions"
    )
