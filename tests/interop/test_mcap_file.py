"""Foxglove's reader and ROS 2 decoder can read exported MCAP files."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from tests.cli.test_record_verbs import vsnbench
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.queries import episode_record, episode_steps
from vsnbench.results.schema.migrate import open_record


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An episode in the apartment (1), and one without images (2)."""
    folder = tmp_path_factory.mktemp("recorded")
    words = ["--model", "random", "--goal", "chair", "--max-steps", "6", "--seed", "3", "-q"]
    assert vsnbench(folder, "run", *words, "--starts", "5").returncode == 0
    assert vsnbench(folder, "run", *words, "--starts", "4", "--keep", "none").returncode == 0
    return folder


def read(file: Path) -> tuple[dict[str, list[tuple[int, Any]]], Any]:
    heard: dict[str, list[tuple[int, Any]]] = {}
    with file.open("rb") as opened:
        reader = make_reader(opened, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            heard.setdefault(channel.topic, []).append((message.log_time, decoded))
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        return heard, (reader.get_summary(), metadata)


def test_images_odometry_and_stamps_are_those_of_the_record(results: Path, tmp_path: Path) -> None:
    done = vsnbench(results, "export", "mcap", "1", "--output", str(tmp_path), "--json")
    assert json.loads(done.stdout) == {"files": [str(tmp_path / "000001.mcap")]}
    heard, (summary, metadata) = read(tmp_path / "000001.mcap")
    with open_record(sqlite_url(results / "vsnbench.db")) as engine:
        steps, details = episode_steps(engine, 1), episode_record(engine, 1)
    began_s = details.started_at.timestamp()
    stamps_s = [began_s + step.stamp_s for step in steps if step.stamp_s is not None]
    for step, stamp_s, (log_ns, color), (_, depth) in zip(
        steps, stamps_s, heard["/camera/color/image_raw/compressed"], heard["/camera/depth/image_raw"], strict=True
    ):
        folder = results / "episodes" / "000001"
        assert bytes(color.data) == (folder / "rgb" / f"{step.number:04d}.jpg").read_bytes()
        recorded = cv2.imread(str(folder / "depth" / f"{step.number:04d}.png"), cv2.IMREAD_UNCHANGED)
        assert recorded is not None
        pixels = np.frombuffer(bytes(depth.data), "<u2").reshape(depth.height, depth.width)
        assert (depth.encoding, bool((pixels == recorded).all())) == ("16UC1", True)
        for message in (color, depth):
            assert message.header.stamp.sec + message.header.stamp.nanosec / 1e9 == pytest.approx(stamp_s, abs=2e-6)
        assert log_ns / 1e9 == pytest.approx(stamp_s, abs=2e-6)
    expected = [pose for step in steps for pose in (step.observed, step.after) if pose is not None]
    driven = [message.pose.pose for _, message in heard["/odom"]]
    assert [(pose.position.x, pose.position.y) for pose in driven] == [(pose.x_m, pose.y_m) for pose in expected]
    assert [message.data for _, message in heard["/vsnbench/action"]] == [
        "BLOCKED" if step.blocked else step.action.value for step in steps
    ]
    assert heard["/camera/color/camera_info"][0][1].k[0] > 100
    assert metadata["vsnbench"]["goal"] == "chair"
    assert {schema.name: schema.encoding for schema in summary.schemas.values()} == dict.fromkeys(
        (
            "sensor_msgs/msg/CompressedImage",
            "sensor_msgs/msg/CameraInfo",
            "sensor_msgs/msg/Image",
            "nav_msgs/msg/Odometry",
            "tf2_msgs/msg/TFMessage",
            "std_msgs/msg/String",
        ),
        "ros2msg",
    )


def test_an_episode_without_images_becomes_a_file_without_images(results: Path, tmp_path: Path) -> None:
    assert vsnbench(results, "export", "mcap", "2", "--output", str(tmp_path)).returncode == 0
    heard, _ = read(tmp_path / "000002.mcap")
    assert set(heard) == {"/odom", "/tf", "/tf_static", "/vsnbench/action", "/vsnbench/goal"}


def test_all_that_ended_become_a_file_each(results: Path, tmp_path: Path) -> None:
    assert vsnbench(results, "export", "mcap", "--output", str(tmp_path)).returncode == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["000001.mcap", "000002.mcap"]
