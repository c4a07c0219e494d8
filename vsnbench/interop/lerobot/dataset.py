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
from vsnbench.interop.lerobot.features import CAMERA, DEPTH, ENCODING, FRAMES_PER_S, arrow_schema, columns, features
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
        UsageError: a library is missing, the directory has content, or the sizes of images differ.
        RecordError: a file cannot be written, or an image is damaged.
    """
    require_libraries()
    require_empty(directory)
    color_size = _only_size(episodes, [frames.color.sizes for frames in episodes], "images")
    depth_sizes = [frames.depth.sizes for frames in episodes if frames.depth is not None]
    depth_size = _only_size(episodes, depth_sizes, "depth images") if depth_sizes else None
    directory = directory.resolve()
    part = part_path(directory)
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        for left in part.parent.glob(f".*{PART}"):
            if left.name.startswith(f".{directory.name}."):
                sweep_part_directory(left)
        part.mkdir()
        _Writer(episodes, part, features(color_size, depth_size), progress).write()
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


def _only_size(episodes: Sequence[EpisodeFrames], sizes: Sequence[Sizes], what: str) -> tuple[int, int]:
    found: dict[tuple[int, int], list[int]] = {}
    for frames, of_episode in zip(episodes, sizes, strict=True):
        for size in of_episode:
            found.setdefault(size, []).append(frames.episode.id)
    if len(found) > 1:
        listed = "; ".join(
            f"{width}x{height} in {', '.join(map(str, numbers[:5]))}{', …' if len(numbers) > 5 else ''}"
            for (width, height), numbers in sorted(found.items())
        )
        raise UsageError(
            f"the {what} of the episodes have several sizes ({listed}), and a dataset has one",
            advice="export the episodes of each size to a directory of their own, by number or with --model and --goal",
            code="mixed-image-sizes",
        )
    return next(iter(found))


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
        self._write_videos(frames)
        each = self._write_data()
        statistics = {name: vector_statistics(np.concatenate([part[name] for part in each])) for name in each[0]}
        for key, counts in self._total.items():
            statistics[key] = image_statistics(counts, frames, _full_scale(key))
        write_metadata(
            self._directory,
            self._features,
            self._tasks,
            self._episodes,
            [(written.row, written.statistics) for written in self._written],
            {name: statistics[name] for name in self._features},
        )

    def _write_videos(self, frames: int) -> None:
        done = 0
        files = packed([episode.color.content_bytes for episode in self._episodes], VIDEO_FILE_MB * 2**20)
        for file, members in groupby(range(len(files)), files.__getitem__):
            numbers = list(members)

            def pixels(numbers: list[int] = numbers) -> Iterator[npt.NDArray[np.uint8]]:
                nonlocal done
                for number in numbers:
                    for rgb in self._counted(CAMERA, number, self._episodes[number].color):
                        yield rgb
                        done += 1
                        self._progress(done, frames)

            write_mp4(pixels(), self._directory / path_in(f"videos/{CAMERA}", file, "mp4"), FRAMES_PER_S, ENCODING)
            began = 0
            for number in numbers:
                ended = began + len(self._episodes[number])
                self._written[number].row |= {
                    f"videos/{CAMERA}/chunk_index": file // CHUNK_FILES,
                    f"videos/{CAMERA}/file_index": file % CHUNK_FILES,
                    f"videos/{CAMERA}/from_timestamp": began / FRAMES_PER_S,
                    f"videos/{CAMERA}/to_timestamp": ended / FRAMES_PER_S,
                }
                began = ended

    def _write_data(self) -> list[dict[str, npt.NDArray[Any]]]:
        """Write the data files, and return the numbers of each episode by feature."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        schema, first, each = arrow_schema(self._features), 0, []
        sizes = [
            len(episode) * _ROW_BYTES + (episode.depth.content_bytes if episode.depth is not None else 0)
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
                    if frames.depth is not None:
                        values[DEPTH] = self._depth_files(number, frames.depth)
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

    def _depth_files(self, number: int, images: RecordedImages) -> list[dict[str, Any]]:
        """Return the PNG files as they are; decoding them is for the statistics."""
        for _ in self._counted(DEPTH, number, images):
            pass
        return [{"bytes": images.read(frame), "path": images.path(frame).name} for frame in range(len(images.numbers))]

    def _counted(self, key: str, number: int, images: RecordedImages) -> Iterator[npt.NDArray[Any]]:
        """Yield the pixels of an episode's images, and keep their statistics."""
        counts: Counts | None = None
        for frame in range(len(images.numbers)):
            pixels = _decoded(images, frame, tuple(self._features[key]["shape"]))
            here = pixel_counts(pixels)
            counts = here if counts is None else counts + here
            yield pixels
        if counts is not None:
            self._written[number].statistics[key] = image_statistics(counts, len(images.numbers), _full_scale(key))
            self._total[key] = self._total[key] + counts if key in self._total else counts


def _full_scale(key: str) -> float:
    """Colours are from 0 to 1 in the statistics; depth is in millimetres."""
    return 255.0 if key == CAMERA else 1.0


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
