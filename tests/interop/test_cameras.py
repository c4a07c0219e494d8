"""Further cameras in exports, in videos and in bundles."""

import json
import math
import re
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from tests.cli.test_record_verbs import vsnbench
from tests.interop.test_bag_messages import turned
from tests.robots.test_cameras import record_of_cameras
from tests.shared_records import write_copy
from vsnbench.interop.bag_messages import optical_turn
from vsnbench.report.analysis.conditions import Selection
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.web.results_browser import single_file
from vsnbench.web.results_browser.single_file import write_single_file

FOLDER = Path("episodes") / "000001"
TOPICS = {
    f"/camera_{role}/{part}"
    for role in ("left", "rear")
    for part in ("color/image_raw/compressed", "color/camera_info", "depth/image_raw", "depth/camera_info")
}


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """An episode of a robot with cameras ahead, to the left and at the rear."""
    write_copy(tmp_path / "results", record_of_cameras)
    return tmp_path / "results"


def exported(results: Path, *words: str) -> None:
    done = vsnbench(results, "export", *words)
    assert done.returncode == 0, done.stderr


def test_mcap_and_bag_have_a_topic_and_a_frame_of_each_camera(results: Path, tmp_path: Path) -> None:
    exported(results, "mcap", "1", "--output", str(tmp_path))
    exported(results, "bag", "1", "--output", str(tmp_path / "1.bag"))
    heard: dict[str, list] = {}
    with (tmp_path / "000001.mcap").open("rb") as opened:
        for _, channel, _, message in make_reader(opened, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            heard.setdefault(channel.topic, []).append(message)
    assert heard.keys() >= TOPICS
    for number, message in enumerate(heard["/camera_left/color/image_raw/compressed"], start=1):
        assert bytes(message.data) == (results / FOLDER / "rgb" / f"{number:04d}-left.jpg").read_bytes()
        assert message.header.frame_id == "left_camera_optical_frame"
    frames = {each.child_frame_id: each.transform for message in heard["/tf_static"] for each in message.transforms}
    left = frames["left_camera_optical_frame"]
    assert left.translation.y == pytest.approx(0.1)
    q = left.rotation
    assert turned((q.x, q.y, q.z, q.w), np.array([0.0, 0.0, 1.0])) == pytest.approx([0, 1, 0], abs=1e-9)
    with AnyReader([tmp_path / "1.bag"]) as reader:
        counts = {each.topic: each.msgcount for each in reader.connections}
    assert {counts[topic] for topic in TOPICS} == {4}


@pytest.mark.parametrize(("yaw_deg", "tilt_deg"), [(90, -20), (180, 30), (-90, 0)])
def test_the_optical_axis_follows_yaw_and_tilt(yaw_deg: float, tilt_deg: float) -> None:
    yaw, tilt = math.radians(yaw_deg), math.radians(tilt_deg)
    ahead = [math.cos(yaw) * math.cos(tilt), math.sin(yaw) * math.cos(tilt), math.sin(tilt)]
    right = [math.sin(yaw), -math.cos(yaw), 0]
    turn = optical_turn(tilt_deg, yaw_deg)
    assert turned(turn, np.array([0.0, 0.0, 1.0])) == pytest.approx(ahead, abs=1e-9)
    assert turned(turn, np.array([1.0, 0.0, 0.0])) == pytest.approx(right, abs=1e-9)


def test_a_dataset_has_a_feature_of_each_camera(results: Path, tmp_path: Path) -> None:
    exported(results, "lerobot", "--depth", "--output", str(tmp_path / "dataset"))
    features = json.loads((tmp_path / "dataset/meta/info.json").read_text())["features"]
    for role in ("camera", "left", "rear"):
        name = f"observation.images.{role}"
        assert (features[name]["dtype"], features[name]["shape"]) == ("video", [120, 160, 3])
        with av.open(str(tmp_path / f"dataset/videos/{name}/chunk-000/file-000.mp4")) as video:
            frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
        suffix = "" if role == "camera" else f"-{role}"
        written = cv2.imread(str(results / FOLDER / "rgb" / f"0002{suffix}.jpg"))
        assert len(frames) == 4
        assert np.abs(frames[1].astype(int) - written[..., ::-1]).mean() < 6
    depths = [f"observation.images.{name}" for name in ("depth", "left_depth", "rear_depth")]
    assert [features[name]["info"]["depth_unit"] for name in depths] == ["mm"] * 3


def test_episodes_of_other_cameras_need_a_dataset_of_their_own(results: Path, tmp_path: Path) -> None:
    other = ["--robot", "simulated:turtlebot2@160x120", "--model", "oracle", "--goal", "chair", "--starts", "1"]
    assert vsnbench(results, "run", *other, "-q").returncode == 0
    done = vsnbench(results, "export", "lerobot", "--output", str(tmp_path / "dataset"))
    assert done.returncode == 2
    assert "camera in 2; camera, left, rear in 1" in " ".join(done.stderr.split())
    assert not (tmp_path / "dataset").exists()


def test_a_video_shows_each_camera(results: Path, tmp_path: Path) -> None:
    paint(results, {"": (0, 0, 255), "-left": (0, 255, 0), "-rear": (255, 0, 0)})
    exported(results, "video", "1", "--output", str(tmp_path / "1.mp4"))
    with av.open(str(tmp_path / "1.mp4")) as video:
        frame = next(video.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    shares = [float((frame[..., band] - frame.sum(axis=2) / 3 > 100).mean()) for band in range(3)]
    assert shares[0] > 4 * shares[1] > 0.02, "the main camera is larger"
    assert shares[1] == pytest.approx(shares[2], rel=0.05)


def paint(results: Path, colors: dict[str, tuple[int, int, int]]) -> None:
    """Give the images of each camera one colour, blue, green and red."""
    for suffix, color in colors.items():
        for file in (results / FOLDER / "rgb").glob(f"[0-9][0-9][0-9][0-9]{suffix}.jpg"):
            cv2.imwrite(str(file), np.full((120, 160, 3), color, np.uint8))


def test_a_bundle_has_the_images_of_each_camera(results: Path, tmp_path: Path) -> None:
    bundle = tmp_path / "record.zip"
    done = vsnbench(results, "bundle", "--campaign", "1", str(bundle))
    assert done.returncode == 0, done.stderr
    verified = vsnbench(results, "verify", str(bundle))
    assert verified.returncode == 0, verified.stdout + verified.stderr


def test_a_website_and_a_single_file_have_the_images_of_each_camera(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["report", "--website", str(tmp_path / "site"), "--without-videos"]
    assert vsnbench(results, *words).returncode == 0
    names = {file.stem for file in (tmp_path / "site/images/1").iterdir()}
    assert names == {f"{number}{suffix}" for number in range(1, 5) for suffix in ("", "-left", "-rear")}
    rooms, every = [], single_file._every
    monkeypatch.setattr(single_file, "_every", lambda shown, most: rooms.append(most) or every(shown, most))
    pictures, cameras = written(results, tmp_path / "results.html")
    assert (set(pictures), cameras) == (names, "all")
    for_main = sum(len(picture) + 100 for name, picture in pictures.items() if "-" not in name)
    monkeypatch.setattr(single_file, "MAX_BYTES", single_file.MAX_BYTES - rooms[0] + for_main)
    pictures, cameras = written(results, tmp_path / "results.html")
    assert (set(pictures), cameras) == ({"1", "2", "3", "4"}, "main")


def written(results: Path, file: Path) -> tuple[dict[str, str], str]:
    """Write a single file; return the pictures of its episode, and of which cameras it says it has some."""
    write_single_file(ResultsDirectory.locate(results, None), Selection(), file)
    page = file.read_text(encoding="utf-8")
    pictures, cameras = re.search(r'id="images/1">(.*?)</script>', page), re.search(r'data-cameras="(\w+)"', page)
    assert pictures
    assert cameras
    return json.loads(pictures[1]), cameras[1]
