"""Writes the images of an episode (a JPEG and a 16-bit PNG per step) and its trajectory, each atomically.

A step's row is committed after its images are in place, so that every committed step has images.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from vsnbench.errors import RecordError
from vsnbench.files.atomic import write_atomic
from vsnbench.results.files.film import RecordedFrame, StampedPose, film_of, film_path
from vsnbench.results.files.staged_import import clear_unfinished
from vsnbench.values.camera import CameraRole
from vsnbench.values.decision_check import SENSING
from vsnbench.values.encoding.image_digest import StepDigests, depth_digest, file_digest, rgb_digest
from vsnbench.values.encoding.images import depth_millimetres, encode_depth_png, encode_jpeg
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.step import FilmFrame

CAMERAS: Final = "cameras"
"""Key in the `sensing` of a step's details."""
_DIGESTS: Final = ("rgb", "depth", "rgb_file", "depth_file")
FileDigests = tuple[str | None, str | None]


@dataclass(frozen=True, slots=True)
class WrittenImages:
    """Written images of one observation, with the digests of their pixels."""

    rgb_digest: str | None
    """Digest of the image that the policy received; None if none was rendered."""
    depth_digest: str | None
    """Digest of the PNG's millimetres; None without depth."""
    rgb_jpeg: bytes | None
    """Content of the file, for viewers; None without a file."""
    depth_png: bytes | None
    film: tuple[RecordedFrame, ...] = ()
    """Images that were taken before the next observation."""
    cameras: "Mapping[CameraRole, WrittenImages]" = field(default_factory=dict)
    """Images of the further cameras."""

    @property
    def file_digests(self) -> FileDigests:
        """Digests of the bytes of the colour file and the depth file; None without a file."""
        rgb, depth = self.rgb_jpeg, self.depth_png
        return None if rgb is None else file_digest(rgb), None if depth is None else file_digest(depth)


def cameras_to_json(cameras: Mapping[CameraRole, WrittenImages]) -> dict[str, dict[str, str | None]]:
    """Return what the record has of the images of further cameras, by role: digests of pixels and of files."""
    return {
        role.value: dict(zip(_DIGESTS, (images.rgb_digest, images.depth_digest, *images.file_digests), strict=True))
        for role, images in cameras.items()
    }


def step_digests_of(
    number: int, rgb: str | None, depth: str | None, files: FileDigests, details: object
) -> StepDigests:
    """Return the digests of a step from its columns.

    Args:
        number: number of the step, from 1.
        rgb: digest of the colours.
        depth: digest of the depth.
        files: digests of the bytes of both files.
        details: the step's details, which have those of its film and of further cameras; none if they cannot be read.
    """
    film = tuple(frame.file_digest for frame in film_of(details))
    return StepDigests(number, rgb, depth, *files, film, tuple(_further_digests(number, details)))


def _further_digests(number: int, details: object) -> Iterator[tuple[str, StepDigests]]:
    sensing = details.get(SENSING) if isinstance(details, Mapping) else None
    cameras = sensing.get(CAMERAS) if isinstance(sensing, Mapping) else None
    for role in CameraRole:
        stated = cameras.get(role.value) if isinstance(cameras, Mapping) else None
        if isinstance(stated, Mapping):
            pixels, measured, *own = (stated[name] if isinstance(stated.get(name), str) else None for name in _DIGESTS)
            yield role.value, StepDigests(number, pixels, measured, own[0], own[1])


def further_images(details: object, *, depth: bool = False) -> tuple[str, ...]:
    """Return the roles of the further cameras whose colours, or depth, a step with these details has."""
    seen = _further_digests(0, details)
    return tuple(role for role, digests in seen if (digests.depth if depth else digests.rgb) is not None)


def hash_images(observation: Observation) -> WrittenImages:
    """Return the digests of an observation's images without writing them."""
    seen = rgb_digest(observation.rgb) if Sensor.RGB in observation.sensors else None
    measured = None if observation.depth_m is None else depth_digest(depth_millimetres(observation.depth_m))
    further = {role: hash_images(view) for role, view in observation.cameras.items()}
    return WrittenImages(seen, measured, None, None, cameras=further)


def rgb_path(directory: Path, number: int, role: str = "") -> Path:
    """Return the path of a step's colour image, of the main camera or of that with a role; steps count from 1."""
    return directory.joinpath("rgb", f"{number:04d}{role and '-' + role}.jpg")


def depth_path(directory: Path, number: int, role: str = "") -> Path:
    """Return the path of a step's depth image, of the main camera or of that with a role."""
    return directory.joinpath("depth", f"{number:04d}{role and '-' + role}.png")


class EpisodeImages:
    """Image files of one episode. Encoding takes about 3 ms per observation: call it off the control path."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        encode_depth_png(depth_millimetres(np.zeros((1, 1), np.float32)))  # compile before the robot moves
        clear_unfinished(directory)
        try:
            for folder in ("rgb", "depth"):
                (directory / folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordError(
                f"cannot write {directory}: {error.strerror or error}",
                advice="free some space or check the permissions",
            ) from error

    def write(self, number: int, observation: Observation, frames: Sequence[FilmFrame] = ()) -> WrittenImages:
        """Write the images of a step, numbered from 1, and those between it and the next; they are in place on return.

        Raises:
            RecordError: they cannot be written.
        """
        further = {role: self._write(number, view, role) for role, view in observation.cameras.items()}
        return replace(self._write(number, observation), film=self._write_film(number, frames), cameras=further)

    def _write(self, number: int, seen: Observation, role: str = "") -> WrittenImages:
        # Sequentially, because the pixels are still in the CPU cache.
        rgb, jpeg = rgb_digest(seen.rgb), encode_jpeg(seen.rgb)
        write_atomic(rgb_path(self._directory, number, role), jpeg)
        if seen.depth_m is None:
            return WrittenImages(rgb, None, jpeg, None)
        millimetres = depth_millimetres(seen.depth_m)
        measured, png = depth_digest(millimetres), encode_depth_png(millimetres)
        write_atomic(depth_path(self._directory, number, role), png)
        return WrittenImages(rgb, measured, jpeg, png)

    def _write_film(self, number: int, frames: Sequence[FilmFrame]) -> tuple[RecordedFrame, ...]:
        written = []
        for place, frame in enumerate(frames, start=1):
            path, jpeg = film_path(self._directory, number, place), encode_jpeg(frame.rgb)
            path.parent.mkdir(exist_ok=True)
            write_atomic(path, jpeg)
            written.append(
                RecordedFrame(StampedPose(frame.stamp_s, frame.pose), file_digest(jpeg), jpeg, frame.commanded)
            )
        return tuple(written)

    def finish(self, path: Sequence[StampedPose] = ()) -> None:
        """Write the trajectory, if there is one; nothing may be written afterwards.

        Raises:
            RecordError: it cannot be written.
        """
        if path:
            write_atomic(self._directory / "trajectory.tum", trajectory_text(path).encode())


def trajectory_text(poses: Iterable[StampedPose]) -> str:
    """Return a trajectory in the TUM format, which evo and other tools read."""
    return "# timestamp tx ty tz qx qy qz qw\n" + "".join(map(tum_line, poses))


def tum_line(moment: StampedPose) -> str:
    """Return a pose as `timestamp tx ty tz qx qy qz qw`."""
    pose, half = moment.pose, moment.pose.heading_rad / 2
    return f"{moment.stamp_s:.6f} {pose.x_m:.6f} {pose.y_m:.6f} 0 0 0 {np.sin(half):.9f} {np.cos(half):.9f}\n"
