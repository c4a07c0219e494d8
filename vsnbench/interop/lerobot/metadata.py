"""Writes the directory `meta` of a dataset: `info.json`, statistics, tasks and episodes."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from vsnbench.interop.lerobot.features import FRAMES_PER_S, Feature
from vsnbench.interop.lerobot.frames import CAMERA, EpisodeFrames
from vsnbench.interop.lerobot.statistics import Statistics
from vsnbench.results.model import EPISODE

VERSION: Final = "v3.0"
"""Version of the format."""
CHUNK_FILES: Final = 1000
"""Files per directory `chunk-…`."""
DATA_FILE_MB: Final = 100
VIDEO_FILE_MB: Final = 200
_RECORDED: Final = EPISODE.only(
    *("id", "model", "driver", "robot", "simulated", "site", "goal", "start", "end_reason", "success", "counts")
)
_PLACE: Final = "chunk-{chunk_index:03d}/file-{file_index:03d}"


def path_in(directory: str, file: int, suffix: str) -> str:
    """Return the path of a file of the dataset, by its number from 0."""
    place = _PLACE.format(chunk_index=file // CHUNK_FILES, file_index=file % CHUNK_FILES)
    return f"{directory}/{place}.{suffix}"


def write_metadata(
    root: Path,
    features: Mapping[str, Feature],
    tasks: Sequence[str],
    episodes: Sequence[EpisodeFrames],
    written: Sequence[tuple[Mapping[str, Any], Mapping[str, Statistics]]],
    statistics: Mapping[str, Statistics],
) -> None:
    """Write the files.

    `written` has for each episode where its frames are, and its statistics; `statistics` are those of all frames.
    """
    (root / "meta").mkdir()
    robots = {frames.episode.robot for frames in episodes}
    info = {
        "codebase_version": VERSION,
        "fps": FRAMES_PER_S,
        "features": features,
        "total_episodes": len(episodes),
        "total_frames": sum(map(len, episodes)),
        "total_tasks": len(tasks),
        "chunks_size": CHUNK_FILES,
        "data_files_size_in_mb": DATA_FILE_MB,
        "video_files_size_in_mb": VIDEO_FILE_MB,
        "data_path": f"data/{_PLACE}.parquet",
        "video_path": f"videos/{{video_key}}/{_PLACE}.mp4",
        "robot_type": robots.pop() if len(robots) == 1 else None,
        "splits": {"train": f"0:{len(episodes)}"},
    }
    _write_json(root / "meta" / "info.json", info)
    _write_json(root / "meta" / "stats.json", {name: _as_lists(found) for name, found in statistics.items()})
    _write_tasks(root / "meta" / "tasks.parquet", tasks)
    rows = [
        {**row, **_flat(found), **_recorded(frames), "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        for frames, (row, found) in zip(episodes, written, strict=True)
    ]
    _write_episodes(root / path_in("meta/episodes", 0, "parquet"), rows)


def _recorded(frames: EpisodeFrames) -> dict[str, Any]:
    """Return what the record has about an episode, for filters such as `episode_filter`."""
    return {f"vsnbench/{field.heading}": field.of(frames.episode) for field in _RECORDED}


def _as_lists(found: Statistics) -> dict[str, Any]:
    return {name: values.tolist() for name, values in found.items()}


def _flat(found: Mapping[str, Statistics]) -> dict[str, Any]:
    return {
        f"stats/{feature}/{name}": values
        for feature, of_feature in found.items()
        for name, values in _as_lists(of_feature).items()
    }


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False, allow_nan=False), encoding="utf-8")


def _write_tasks(path: Path, tasks: Sequence[str]) -> None:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

    # Strings as objects, which every version of pandas reads.
    index = pd.Series(tasks, dtype=object, name="task")
    pq.write_table(pa.Table.from_pandas(pd.DataFrame({"task_index": range(len(tasks))}).set_index(index)), path)


def _write_episodes(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True)
    ordered = sorted(rows[0], key=lambda name: (name.startswith("stats/"), CAMERA in name))
    pq.write_table(pa.table({name: [row[name] for row in rows] for name in ordered}), path)
