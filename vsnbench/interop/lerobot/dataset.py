"""Writes episodes as a LeRobotDataset v3.0, without LeRobot itself."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RecordError, UsageError
from vsnbench.files.atomic import PART, part_path, sweep_part_directory
from vsnbench.files.mp4 import write_mp4
from vsnbench.installation import command_to_add
from vsnbench.interop.lerobot.features import ENCODING, FRAMES_PER_S, arrow_schema, columns, features
from vsnbench.interop.lerobot.frames import EpisodeFrames, RecordedImages, Sizes
from vsnbench.interop.lerobot.metadata import CHUNK_FILES, DATA_FILE_MB, VIDEO_FILE_MB, path_in, write_metadata
from vsnbench.interop.lerobot.statistics import (
    Counts,
    Statistics,
    image_statistics,
    pixel_counts,
    vector_statistics,
)
from vsnbench.values.encoding.images import decode_picture

_ROW_BYTES = 256
"""More than a row of the data files takes without images."""


@dataclass(slots=True)
class _Written:
    """Where the frames of an episode are, and their statistics."""

    row: dict[str, Any]
    statistics: dict[str, Statistics] = field(default_factory=dict)


def write_dataset(
    episodes: Sequence[EpisodeFrames],
    directory: Path,
    progress: Callable[[int, int], object] = lambda _done, _of: None,
) -> None:
    """Write the dataset; the directory appears when it is complete.

    Args:
        episodes: at least one, all with depth or all without.
        directory: missing or empty.
        progress: called with the frames written and all frames.

    Raises:
        UsageError: a library is missing, the directory has content, or cameras or the sizes of their images differ.
        RecordError: a file cannot be written, or an image is damaged.
    """
    require_libraries()
    require_empty(directory)
    _require_same_cameras(episodes)
    colors, depths = dict[str, tuple[int, int]](), dict[str, tuple[int, int]]()
    for name, images in episodes[0].images.items():
        what = " ".join(filter(None, (images.role, "depth images" if images.depth else "images")))
        sizes = depths if images.depth else colors
        sizes[name] = _only_size(episodes, [frames.images[name].sizes for frames in episodes], what)
    directory = directory.resolve()
    part = part_path(directory)
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        for left in part.parent.glob(f".*{PART}"):
            if left.name.startswith(f".{directory.name}."):
                sweep_part_directory(left)
        part.mkdir()
        _Writer(episodes, part, features(colors, depths), progress).write()
        part.replace(directory)
    except OSError as error:
        raise RecordError(
            f"cannot write {directory}: {error.strerror or error}", advice="free some space or check the permissions"
        ) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def require_libraries() -> None:
    """Raise an error if a library is missing.

    Raises:
        UsageError: PyAV or pyarrow is not installed.
    """
    try:
        import av  # noqa: F401
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise UsageError(
            "LeRobot datasets require the libraries PyAV and pyarrow",
            advice=command_to_add("lerobot"),
            code="missing-extra",
        ) from error


def require_empty(directory: Path) -> None:
    """Raise an error if there is something that a dataset would replace.

    Raises:
        UsageError: the directory is not empty, or is a file.
    """
    if directory.is_symlink() or (directory.exists() and not directory.is_dir()):
        raise UsageError(f"{directory} is not a directory", advice="give another path", code="not-empty")
    if directory.is_dir() and any(directory.iterdir()):
        advice = "give a new directory; a dataset is not extended"
        raise UsageError(f"{directory} is not empty", advice=advice, code="not-empty")


def _require_same_cameras(episodes: Sequence[EpisodeFrames]) -> None:
    """Raise an error unless all episodes have images of the same cameras.

    Raises:
        UsageError: they do not.
    """
    found: dict[str, list[int]] = {}
    for frames in episodes:
        cameras = ", ".join(name.rpartition(".")[2] for name in frames.images)
        found.setdefault(cameras, []).append(frames.episode.id)
    if len(found) > 1:
        raise UsageError(
            f"the episodes have images of different cameras ({_listed(found)}), and a dataset has one set",
            advice="export the episodes of each robot to a directory of their own, by number",
            code="mixed-cameras",
        )


def _listed(found: dict[str, list[int]]) -> str:
    return "; ".join(
        f"{what} in {', '.join(map(str, numbers[:5]))}{', …' if len(numbers) > 5 else ''}"
        for what, numbers in sorted(found.items())
    )


def _only_size(episodes: Sequence[EpisodeFrames], sizes: Sequence[Sizes], what: str) -> tuple[int, int]:
    found: dict[str, list[int]] = {}
    for frames, of_episode in zip(episodes, sizes, strict=True):
        for width, height in sorted(of_episode):
            found.setdefault(f"{width}x{height}", []).append(frames.episode.id)
    if len(found) > 1:
        raise UsageError(
            f"the {what} of the episodes have several sizes ({_listed(found)}), and a dataset has one",
            advice="export the episodes of each size to a directory of their own, by number or with --model and --goal",
            code="mixed-image-sizes",
        )
    return next(iter(sizes[0]))


def packed(sizes: Sequence[int], limit: int) -> list[int]:
    """Return the number of the file of each item: in order, a new file before the limit is exceeded."""
    files, file, filled = [], 0, 0
    for size in sizes:
        if filled and filled + size > limit:
            file, filled = file + 1, 0
        filled += size
        files.append(file)
    return files


class _Writer:
    def __init__(
        self,
        episodes: Sequence[EpisodeFrames],
        directory: Path,
        named: dict[str, Any],
        progress: Callable[[int, int], object],
    ) -> None:
        self._episodes, self._directory, self._features, self._progress = episodes, directory, named, progress
        self._tasks = list(dict.fromkeys(frames.task for frames in episodes))
        self._written = [_Written({"episode_index": index}) for index in range(len(episodes))]
        self._total: dict[str, Counts] = {}

    def write(self) -> None:
        frames = sum(map(len, self._episodes))
        videos = [name for name, images in self._episodes[0].images.items() if not images.depth]
        for place, name in enumerate(videos):
            self._write_videos(name, place * frames, len(videos) * frames)
        each = self._write_data()
        statistics = {name: vector_statistics(np.concatenate([part[name] for part in each])) for name in each[0]}
        for key, counts in self._total.items():
            statistics[key] = image_statistics(counts, frames, self._full_scale(key))
        write_metadata(
            self._directory,
            self._features,
            self._tasks,
            self._episodes,
            [(written.row, written.statistics) for written in self._written],
            {name: statistics[name] for name in self._features},
        )

    def _write_videos(self, name: str, done: int, frames: int) -> None:
        """Write the videos of one camera, when `done` of all `frames` have been written."""
        files = packed([episode.images[name].content_bytes for episode in self._episodes], VIDEO_FILE_MB * 2**20)
        for file, members in groupby(range(len(files)), files.__getitem__):
            numbers = list(members)

            def pixels(numbers: list[int] = numbers) -> Iterator[npt.NDArray[np.uint8]]:
                nonlocal done
                for number in numbers:
                    for rgb in self._counted(name, number, self._episodes[number].images[name]):
                        yield rgb
                        done += 1
                        self._progress(done, frames)

            write_mp4(pixels(), self._directory / path_in(f"videos/{name}", file, "mp4"), FRAMES_PER_S, ENCODING)
            began = 0
            for number in numbers:
                ended = began + len(self._episodes[number])
                self._written[number].row |= {
                    f"videos/{name}/chunk_index": file // CHUNK_FILES,
                    f"videos/{name}/file_index": file % CHUNK_FILES,
                    f"videos/{name}/from_timestamp": began / FRAMES_PER_S,
                    f"videos/{name}/to_timestamp": ended / FRAMES_PER_S,
                }
                began = ended

    def _write_data(self) -> list[dict[str, npt.NDArray[Any]]]:
        """Write the data files, and return the numbers of each episode by feature."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        schema, first, each = arrow_schema(self._features), 0, []
        sizes = [
            len(episode) * _ROW_BYTES + sum(images.content_bytes for images in episode.images.values() if images.depth)
            for episode in self._episodes
        ]
        files = packed(sizes, DATA_FILE_MB * 2**20)
        for file, members in groupby(range(len(files)), files.__getitem__):
            path = self._directory / path_in("data", file, "parquet")
            path.parent.mkdir(parents=True, exist_ok=True)
            with pq.ParquetWriter(path, schema, compression="snappy") as writer:
                for number in members:
                    frames, written = self._episodes[number], self._written[number]
                    task = self._tasks.index(frames.task)
                    numbers = columns(frames, episode_index=number, first_index=first, task_index=task)
                    each.append(numbers)
                    written.statistics |= {name: vector_statistics(values) for name, values in numbers.items()}
                    values: dict[str, Any] = {
                        name: array.tolist() if array.ndim > 1 else array for name, array in numbers.items()
                    }
                    values |= {
                        name: self._depth_files(name, number, images)
                        for name, images in frames.images.items()
                        if images.depth
                    }
                    # A row group per episode: readers fetch one without the others.
                    writer.write_table(pa.table({name: values[name] for name in schema.names}, schema=schema))
                    written.row |= {
                        "tasks": [frames.task],
                        "length": len(frames),
                        "data/chunk_index": file // CHUNK_FILES,
                        "data/file_index": file % CHUNK_FILES,
                        "dataset_from_index": first,
                        "dataset_to_index": first + len(frames),
                    }
                    first += len(frames)
        return each

    def _depth_files(self, name: str, number: int, images: RecordedImages) -> list[dict[str, Any]]:
        """Return the PNG files as they are; decoding them is for the statistics."""
        for _ in self._counted(name, number, images):
            pass
        return [{"bytes": images.read(frame), "path": images.path(frame).name} for frame in range(len(images.numbers))]

    def _full_scale(self, key: str) -> float:
        """Colours are from 0 to 1 in the statistics; depth is in millimetres."""
        return 255.0 if self._features[key]["dtype"] == "video" else 1.0

    def _counted(self, key: str, number: int, images: RecordedImages) -> Iterator[npt.NDArray[Any]]:
        """Yield the pixels of an episode's images, and keep their statistics."""
        counts: Counts | None = None
        for frame in range(len(images.numbers)):
            pixels = _decoded(images, frame, tuple(self._features[key]["shape"]))
            here = pixel_counts(pixels)
            counts = here if counts is None else counts + here
            yield pixels
        if counts is not None:
            self._written[number].statistics[key] = image_statistics(counts, len(images.numbers), self._full_scale(key))
            self._total[key] = self._total[key] + counts if key in self._total else counts


def _decoded(images: RecordedImages, frame: int, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """Return the pixels of an image: (H, W, 3) RGB of 8 bits, or (H, W) depth of 16 bits."""
    import cv2

    flags = cv2.IMREAD_UNCHANGED if images.depth else cv2.IMREAD_COLOR
    pixels = decode_picture(images.read(frame), flags)
    expected = np.uint16 if images.depth else np.uint8
    dimensions = shape[:2] if images.depth else shape
    if pixels is None or pixels.shape != dimensions or pixels.dtype != expected:
        raise RecordError(
            f"{images.directory / images.path(frame)} is damaged or not an image of {shape[1]} x {shape[0]} pixels",
            advice="restore it, or export the other episodes by number",
            code="damaged-image",
        )
    return pixels if images.depth else np.ascontiguousarray(pixels[..., ::-1])
