"""Exported datasets, read with pyarrow, PyAV and OpenCV, meet the requirements of lerobot 0.6.1.

Names in capitals are lerobot's. `scripts/check_lerobot.py` loads a dataset with lerobot itself.
"""

import json
import logging
import shutil
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.sites.goal_sites import write_site
from vsnbench.cli.results.lerobot_export import LeRobotSummary, export_lerobot
from vsnbench.errors import RecordError, UsageError
from vsnbench.interop.lerobot import dataset
from vsnbench.interop.lerobot.dataset import packed
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.queries import episode_steps
from vsnbench.results.schema.migrate import open_record
from vsnbench.values.movement import Action
from vsnbench.values.step import StepRecord

CAMERA, DEPTH = "observation.images.camera", "observation.images.depth"
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

# lerobot.utils.constants.DEFAULT_FEATURES of 0.6.1: each dataset has these with these types.
DEFAULT_FEATURES = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Episodes of the oracle (1) and of a random model (2, 3); one without images (4)."""
    folder = tmp_path_factory.mktemp("recorded")
    random = ["--model", "random", "--max-steps", "4"]
    for words in (
        ["--model", "oracle", "--goal", "chair", "--starts", "5"],
        [*random, "--goal", "toilet", "--starts", "5,4"],
        [*random, "--goal", "bed", "--starts", "4", "--keep", "none"],
    ):
        assert vsnbench(folder, "run", *words, "--seed", "2", "-q").returncode == 0
    return folder


@pytest.fixture
def results(recorded: Path, tmp_path: Path) -> Path:
    """A copy of the record."""
    return Path(shutil.copytree(recorded, tmp_path / "results"))


@pytest.fixture(scope="module")
def exported(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of the episodes with images, with depth."""
    directory = tmp_path_factory.mktemp("exported") / "dataset"
    assert export(recorded, directory, depth=True).episodes == 3
    return directory


def export(results: Path, directory: Path, *numbers: int, depth: bool = False) -> LeRobotSummary:
    return export_lerobot(ResultsDirectory.locate(results, None), directory, numbers, with_depth=depth)


def info(directory: Path) -> dict[str, Any]:
    return dict(json.loads((directory / "meta/info.json").read_text(encoding="utf-8")))


def rows(file: Path) -> list[dict[str, Any]]:
    return list(pq.read_table(file).to_pylist())


def episodes(directory: Path) -> list[dict[str, Any]]:
    return rows(directory / "meta/episodes/chunk-000/file-000.parquet")


def steps(results: Path, number: int) -> list[StepRecord]:
    with open_record(sqlite_url(results / "vsnbench.db")) as engine:
        return list(episode_steps(engine, number))


def video(directory: Path, episode: dict[str, Any]) -> list[tuple[float, npt.NDArray[np.uint8]]]:
    """Return time and pixels of all frames in the file of an episode."""
    place = {key: episode[f"videos/{CAMERA}/{key}"] for key in ("chunk_index", "file_index")}
    with av.open(str(directory / info(directory)["video_path"].format(video_key=CAMERA, **place))) as opened:
        stream = opened.streams.video[0]
        assert (stream.codec_context.name, opened.format.name.split(",")[0]) == ("h264", "mov")
        return [(float(frame.time or 0.0), frame.to_ndarray(format="rgb24")) for frame in opened.decode(stream)]


def test_info_has_every_field_of_the_loader(exported: Path) -> None:
    content = info(exported)
    # The fields of lerobot.datasets.utils.DatasetInfo of 0.6.1, which warns about others.
    assert {key: content[key] for key in content if key not in ("features", "data_path", "video_path")} == {
        "codebase_version": "v3.0",
        "fps": 1,
        "total_episodes": 3,
        "total_frames": sum(row["length"] for row in episodes(exported)),
        "total_tasks": 2,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "robot_type": "turtlebot2",
        "splits": {"train": "0:3"},
    }
    features = content["features"]
    for name, dtype in DEFAULT_FEATURES.items():
        assert features[name] == {"dtype": dtype, "shape": [1], "names": None}
    # feature_utils._validate_feature_names; LeRobotDatasetMetadata.names reads `names` of each feature.
    assert all("/" not in name and set(feature) >= {"dtype", "shape", "names"} for name, feature in features.items())
    assert features["discrete_action"]["names"] == {"actions": [action.value for action in Action]}
    # LeRobotDatasetMetadata.depth_keys and DatasetReader._image_depth_units.
    assert (features[DEPTH]["dtype"], features[DEPTH]["shape"]) == ("image", [480, 640, 1])
    assert features[DEPTH]["info"] == {"is_depth_map": True, "depth_unit": "mm"}
    # feature_utils.dataset_to_policy_features puts channels first if they are named last.
    assert (features[CAMERA]["dtype"], features[CAMERA]["names"]) == ("video", ["height", "width", "channels"])
    assert features[CAMERA]["shape"] == [480, 640, 3]


def test_data_files_have_the_types_of_the_features(exported: Path) -> None:
    # feature_utils.get_hf_features_from_features: a scalar for the shape (1,), a list of fixed length for a vector,
    # an image as bytes with a path, and no column for a video.
    file = pq.ParquetFile(exported / "data/chunk-000/file-000.parquet")
    schema, features = file.schema_arrow, info(exported)["features"]
    assert schema.names == [name for name, feature in features.items() if feature["dtype"] != "video"]
    types = {"float32": pa.float32(), "float64": pa.float64(), "int64": pa.int64(), "bool": pa.bool_()}
    for name in set(schema.names) - {DEPTH}:
        (length,), value = features[name]["shape"], types[features[name]["dtype"]]
        assert schema.field(name).type == (value if length == 1 else pa.list_(value, length)), name
    assert schema.field(DEPTH).type == pa.struct({"bytes": pa.binary(), "path": pa.string()})
    kinds = json.loads(schema.metadata[b"huggingface"])["info"]["features"]
    assert {name: kind["_type"] for name, kind in kinds.items() if kind["_type"] != "Value"} == {
        DEPTH: "Image",
        "observation.state": "List",
        "action": "List",
    }
    # io_utils.write_table_one_row_group_per_episode
    assert [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)] == [
        row["length"] for row in episodes(exported)
    ]


def test_states_and_actions_are_those_of_the_record(exported: Path, recorded: Path) -> None:
    data = rows(exported / "data/chunk-000/file-000.parquet")
    assert [row["index"] for row in data] == list(range(len(data)))
    for number, (episode, success) in enumerate([(1, True), (2, False), (3, False)]):
        taken = steps(recorded, episode)
        frames = [row for row in data if row["episode_index"] == number]
        began_s = taken[0].stamp_s
        assert began_s is not None
        for frame, (row, step) in enumerate(zip(frames, taken, strict=True)):
            assert step.observed is not None
            assert step.after is not None
            assert step.stamp_s is not None
            before, after = step.observed, step.after
            assert row["observation.state"] == pytest.approx((before.x_m, before.y_m, before.heading_rad), abs=1e-6)
            moved, stop = after.relative_to(before), step.action is Action.STOP
            assert row["action"] == pytest.approx((moved.x_m, moved.y_m, moved.heading_rad, float(stop)), abs=1e-6)
            assert list(Action)[row["discrete_action"]] is step.action
            assert row["blocked"] is step.blocked
            assert row["robot_time_s"] == pytest.approx(step.stamp_s - began_s, abs=1e-5)
            assert (row["frame_index"], row["timestamp"]) == (frame, frame)
            last = frame == len(taken) - 1
            assert (row["next.done"], row["next.success"]) == (last, last and success)
    assert any(row["action"][0] > 0.2 for row in data)
    assert any(abs(row["action"][2]) > 0.4 for row in data)


def test_images_are_those_of_the_record_within_the_codec(exported: Path, recorded: Path) -> None:
    for row in episodes(exported):
        shown = video(exported, row)
        # DatasetReader._query_videos looks for the image at from_timestamp + timestamp, within 0.1 ms.
        first, last = row[f"videos/{CAMERA}/from_timestamp"], row[f"videos/{CAMERA}/to_timestamp"]
        assert last - first == row["length"]
        of_episode = [(time, pixels) for time, pixels in shown if first - 1e-4 <= time < last - 1e-4]
        for frame, (time, pixels) in enumerate(of_episode):
            assert time == pytest.approx(first + frame, abs=1e-4)
            file = recorded / f"episodes/{row['vsnbench/episode']:06d}/rgb/{frame + 1:04d}.jpg"
            original = cv2.imread(str(file))
            assert original is not None
            error = np.mean((pixels.astype(float) - original[..., ::-1]) ** 2)
            assert 10 * np.log10(255**2 / error) > 38
        assert len(of_episode) == row["length"]


def test_depth_images_are_the_files_of_the_record(exported: Path, recorded: Path) -> None:
    data = rows(exported / "data/chunk-000/file-000.parquet")
    numbers = [row["vsnbench/episode"] for row in episodes(exported)]
    for row in data:
        file = recorded / f"episodes/{numbers[row['episode_index']]:06d}/depth/{row['frame_index'] + 1:04d}.png"
        assert row[DEPTH]["bytes"] == file.read_bytes()


def test_statistics_are_those_of_numpy(exported: Path, recorded: Path) -> None:
    found = json.loads((exported / "meta/stats.json").read_text(encoding="utf-8"))
    data = rows(exported / "data/chunk-000/file-000.parquet")
    assert set(found) == set(info(exported)["features"])
    numbers = [row["vsnbench/episode"] for row in episodes(exported)]
    arrays = {
        name: np.array([row[name] for row in data], float).reshape(len(data), -1)
        for name in set(found) - {CAMERA, DEPTH}
    }
    folders = [recorded / f"episodes/{number:06d}" for number in numbers]
    colors = [cv2.imread(str(file)) for folder in folders for file in sorted(folder.glob("rgb/*.jpg"))]
    arrays[CAMERA] = np.stack([image[..., ::-1] / 255 for image in colors if image is not None]).reshape(-1, 3)
    depths = [cv2.imread(str(file), -1) for folder in folders for file in sorted(folder.glob("depth/*.png"))]
    arrays[DEPTH] = np.stack([image for image in depths if image is not None]).reshape(-1, 1).astype(float)
    for name, values in arrays.items():
        expected = {key: getattr(values, key)(axis=0) for key in ("min", "max", "mean", "std")}
        expected |= {key: np.quantile(values, share, axis=0) for key, share in QUANTILES.items()}
        assert set(found[name]) == {*expected, "count"}
        assert found[name]["count"] == [len(data)]
        # compute_stats._validate_stat_value: statistics of images have the shape (channels, 1, 1).
        shape = (len(values[0]), 1, 1) if name in (CAMERA, DEPTH) else (len(values[0]),)
        for key, value in expected.items():
            assert np.shape(found[name][key]) == shape
            np.testing.assert_allclose(np.ravel(found[name][key]), value, rtol=1e-6, atol=1e-9)


def test_each_episode_has_its_place_and_statistics(exported: Path, recorded: Path) -> None:
    found = episodes(exported)
    assert [(row["episode_index"], row["vsnbench/episode"]) for row in found] == [(0, 1), (1, 2), (2, 3)]
    assert [row["tasks"] for row in found] == [["find a chair"], ["find a toilet"], ["find a toilet"]]
    first = 0
    for row in found:
        assert row["length"] == len(steps(recorded, row["vsnbench/episode"]))
        assert (row["dataset_from_index"], row["dataset_to_index"]) == (first, first + row["length"])
        first = row["dataset_to_index"]
        # LeRobotDatasetMetadata.get_data_file_path, get_video_file_path and _save_episode_metadata.
        for name in ("data", f"videos/{CAMERA}", "meta/episodes"):
            assert (row[f"{name}/chunk_index"], row[f"{name}/file_index"]) == (0, 0)
        assert row["stats/index/min"] == [row["dataset_from_index"]]
        assert np.shape(row[f"stats/{CAMERA}/mean"]) == (3, 1, 1)
        assert row[f"stats/{DEPTH}/count"] == [row["length"]]
    assert [row["vsnbench/success"] for row in found] == [True, False, False]
    # io_utils.load_tasks: the texts are the index of a DataFrame.
    tasks = pq.read_table(exported / "meta/tasks.parquet").to_pandas()
    assert (tasks.index.name, tasks["task_index"].to_dict()) == ("task", {"find a chair": 0, "find a toilet": 1})


def test_the_command_counts_and_leaves_out_what_has_no_images(recorded: Path, tmp_path: Path) -> None:
    done = vsnbench(recorded, "export", "lerobot", "-o", str(tmp_path / "d"), "--json")
    assert done.returncode == 0, done.stderr
    frames = sum(len(steps(recorded, number)) for number in (1, 2, 3))
    assert json.loads(done.stdout) == {
        "files": [str(tmp_path / "d")],
        "episodes": 3,
        "frames": frames,
        "left_out": {"4": "no-images"},
    }
    assert DEPTH not in info(tmp_path / "d")["features"]
    assert vsnbench(recorded, "export", "lerobot", "-o", str(tmp_path / "o"), "--goal", "toilet").returncode == 0
    assert [row["vsnbench/episode"] for row in episodes(tmp_path / "o")] == [2, 3]


def test_a_directory_with_content_is_left_alone(recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("mine")
    with pytest.raises(UsageError) as refused:
        export(recorded, tmp_path)
    assert refused.value.code == "not-empty"
    assert [file.name for file in tmp_path.iterdir()] == ["kept"]
    (tmp_path / "empty").mkdir()
    assert export(recorded, tmp_path / "empty", 2).episodes == 1


def test_episodes_that_miss_something_are_left_out(
    results: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (results / "episodes/000001/rgb/0002.jpg").unlink()
    (results / "episodes/000002/depth/0001.png").unlink()
    with caplog.at_level(logging.WARNING):
        done = export(results, tmp_path / "d", depth=True)
    assert done.left_out == {1: "no-images", 2: "no-depth", 4: "no-images"}
    assert len(caplog.messages) == 3
    assert export(results, tmp_path / "e").left_out == {1: "no-images", 4: "no-images"}
    with pytest.raises(UsageError) as refused:
        export(results, tmp_path / "f", 4)
    assert (refused.value.code, (tmp_path / "f").exists()) == ("no-images", False)


def test_episodes_without_a_verdict_are_left_out(results: Path, tmp_path: Path) -> None:
    words = ["--model", "random", "--goal", "bed", "--starts", "1", "--max-steps", "2", "-q"]
    done = vsnbench(results, "run", *words, "--rehearse", "--unattended")
    number = max(int(path.name) for path in (results / "episodes").iterdir() if path.name.isdecimal())
    assert number == 5, done.stderr
    assert export(results, tmp_path / "d").left_out[5] == "unjudged-episode"


def resize(directory: Path, width: int, height: int) -> None:
    for file in directory.glob("rgb/*.jpg"):
        image = cv2.imread(str(file))
        assert image is not None
        assert cv2.imwrite(str(file), cv2.resize(image, (width, height)))


def test_images_of_several_sizes_are_refused(results: Path, tmp_path: Path) -> None:
    resize(results / "episodes/000002", 320, 240)
    with pytest.raises(UsageError) as refused:
        export(results, tmp_path / "d")
    assert refused.value.code == "mixed-image-sizes"
    assert "320x240 in 2" in refused.value.statement
    assert [path.name for path in tmp_path.iterdir()] == ["results"]
    assert export(results, tmp_path / "small", 2).episodes == 1
    assert info(tmp_path / "small")["features"][CAMERA]["shape"] == [240, 320, 3]


def test_images_with_odd_sides_keep_their_size(results: Path, tmp_path: Path) -> None:
    resize(results / "episodes/000002", 161, 119)
    export(results, tmp_path / "d", 2)
    (row,) = episodes(tmp_path / "d")
    assert {pixels.shape for _, pixels in video(tmp_path / "d", row)} == {(119, 161, 3)}
    assert info(tmp_path / "d")["features"][CAMERA]["info"]["video.pix_fmt"] == "yuv444p"


def test_a_damaged_image_leaves_nothing_behind(results: Path, tmp_path: Path) -> None:
    file = results / "episodes/000002/rgb/0002.jpg"
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises((RecordError, UsageError)) as refused:
        export(results, tmp_path / "d", 2)
    assert refused.value.code in ("damaged-image", "no-images")
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_large_datasets_have_several_files(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dataset, "VIDEO_FILE_MB", 0)
    monkeypatch.setattr(dataset, "DATA_FILE_MB", 0)
    export(recorded, tmp_path / "d")
    for number, row in enumerate(episodes(tmp_path / "d")):
        assert (row[f"videos/{CAMERA}/file_index"], row["data/file_index"]) == (number, number)
        assert row[f"videos/{CAMERA}/from_timestamp"] == 0
        assert len(video(tmp_path / "d", row)) == row["length"]
        data = rows(tmp_path / "d" / f"data/chunk-000/file-{number:03d}.parquet")
        assert [entry["index"] for entry in data] == list(range(row["dataset_from_index"], row["dataset_to_index"]))


def test_items_are_packed_in_order() -> None:
    assert packed([3, 3, 3, 9, 1], limit=6) == [0, 0, 1, 2, 3]
    assert packed([7], limit=6) == [0]


def test_tasks_are_the_words_of_the_goals(tmp_path: Path) -> None:
    site, results = write_site(tmp_path), tmp_path / "results"
    goals = ["red-armchair", "photo-bed", "cold-box", "to-the-kitchen"]
    for goal in goals:
        words = ["--site", str(site), "--goal", goal, "--starts", "1", "--model", "oracle", "--max-steps", "1", "-q"]
        assert vsnbench(results, "run", *words).returncode == 0
    export(results, tmp_path / "d")
    assert [row["tasks"][0] for row in episodes(tmp_path / "d")] == [
        "find the red armchair",
        "find what the photograph photo-bed shows",
        "find a refrigerator",
        "leave the bedroom and stop in the kitchen",
    ]
