import json
import shutil
import sqlite3
from pathlib import Path

import av
import numpy as np
import numpy.typing as npt
import pytest

from tests.cli.test_record_verbs import vsnbench
from vsnbench import palette
from vsnbench.palette import rgb
from vsnbench.viewer.video.canvas import PAPER

SUCCESS, FAILURE = rgb(palette.SUCCESS), rgb(palette.FAILURE)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Episodes in the apartment: two of the oracle (1, 2), one of a random model (3), one without images (4)."""
    folder = tmp_path_factory.mktemp("recorded")
    for words in (
        ["--model", "oracle", "--goal", "chair", "--starts", "5,4"],
        ["--model", "random", "--goal", "chair", "--starts", "5", "--max-steps", "3"],
        ["--model", "random", "--goal", "bed", "--starts", "5", "--max-steps", "3", "--keep", "none"],
    ):
        assert vsnbench(folder, "run", *words, "--seed", "1", "-q").returncode == 0
    return folder


@pytest.fixture
def results(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the record; videos without a path are written next to it."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(recorded, tmp_path / "results"))


def frames(file: Path) -> list[npt.NDArray[np.uint8]]:
    with av.open(str(file)) as opened:
        stream = opened.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        return [frame.to_ndarray(format="rgb24") for frame in opened.decode(stream)]


def actions(results: Path, number: int) -> int:
    return int(json.loads(vsnbench(results, "episodes", "show", str(number), "--json").stdout)["actions"])


def close(pixel: npt.NDArray[np.uint8], color: tuple[int, int, int]) -> bool:
    return bool(np.abs(pixel.astype(int) - color).max() < 12)


def test_an_episode_is_a_frame_per_action_and_two_seconds_of_its_verdict(results: Path) -> None:
    done = vsnbench(results, "export", "video", "1")
    assert (done.returncode, done.stdout) == (0, "episode-000001.mp4\n"), done.stderr
    shown = frames(Path("episode-000001.mp4"))
    assert len(shown) == actions(results, 1) + 2 * 4
    assert shown[0].shape == (720, 1280, 3)
    assert close(shown[-1][715, 5], SUCCESS)
    assert not close(shown[-9][715, 5], SUCCESS)
    moved = np.abs(shown[3].astype(int) - shown[0]).mean(axis=2) > 40
    assert moved[60:640, :900].any(), "the camera's image changes"
    assert moved[40:330, 910:].any(), "the robot moves on the plan"
    assert not any(close(pixel, PAPER) for pixel in shown[0][700, 5:900:50]), "the camera fills the height"
    curve = shown[-9][440:620, 915:1270].astype(int)
    assert (curve[..., 2] - curve[..., 0] > 60).any(), "the distance until then, below plan and action"


def test_a_pair_has_one_time_axis_and_the_shorter_one_keeps_its_verdict(results: Path) -> None:
    assert vsnbench(results, "export", "video", "1", "3", "--pair", "-o", "both.mp4", "--size", "web").returncode == 0
    shown = frames(Path("both.mp4"))
    assert shown[0].shape == (480, 854, 3)
    assert len(shown) == max(actions(results, 1), actions(results, 3)) + 2 * 4
    first_end = actions(results, 3)
    assert close(shown[first_end][335, 440], FAILURE)
    assert not close(shown[first_end][335, 5], SUCCESS)
    assert close(shown[-1][335, 5], SUCCESS)
    assert close(shown[-1][335, 440], FAILURE)


def test_a_montage_and_failures_are_chosen_by_options(results: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert vsnbench(results, "export", "video", "--goal", "chair", "--montage", "--speed", "10").returncode == 0
    assert len(frames(Path("montage.mp4"))) == max(actions(results, number) for number in (1, 2, 3)) + 2 * 10
    done = vsnbench(results, "export", "video", "--failures", "--json")
    assert json.loads(done.stdout) == {"files": ["videos/episode-000003.mp4"]}
    assert [record.args for record in caplog.records if "left out" in record.message] == [("episode 4 has no images",)]


def test_a_hostile_name_and_a_damaged_image_still_become_a_video(results: Path) -> None:
    with sqlite3.connect(results / "vsnbench.db") as database:
        database.execute("UPDATE model SET name = ?", ("\x1b[31m<script>\u202e" + "x" * 500,))
    (results / "episodes" / "000001" / "rgb" / "0002.jpg").write_bytes(b"not an image")
    assert vsnbench(results, "export", "video", "1").returncode == 0
    assert len(frames(Path("episode-000001.mp4"))) == actions(results, 1) + 8


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["99"],
        ["4"],
        ["1", "--pair"],
        ["1", "3", "--pair", "--montage"],
        ["1", "--goal", "chair"],
        ["1", "3", "-o", "one.mp4"],
        ["1", "--size", "cinema"],
        ["--model", "oracle", "--failures"],
        ["1", "-o", "/proc/none/episode.mp4"],
    ],
)
def test_what_cannot_become_a_video_is_said_in_one_line(results: Path, words: list[str]) -> None:
    done = vsnbench(results, "export", "video", *words)
    assert done.returncode in (1, 2)
    assert done.stderr.count("\n") == 1, done.stderr
    assert not list(Path.cwd().glob("*.mp4"))
