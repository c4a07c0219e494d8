"""The adapters against upstream's own servers, out of checkouts, on a CPU with random weights.

$VSNBENCH_UPSTREAM is a directory with checkouts of the repositories, by their names; $VSNBENCH_UPSTREAM_PYTHON is a
Python with torch, torchvision, flask, opencv-python-headless, imageio[ffmpeg], matplotlib, efficientnet_pytorch,
diffusers and einops; for UniGoal also msgpack, websockets, omegaconf, scikit-image, scikit-fmm, scikit-learn, numba,
numpy-quaternion, networkx, grakel, supervision==0.21.0, faiss-cpu and open3d. `run_upstream.py` says what of a server
is replaced.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.examples.adapter_trials import driven, lay_out, process, tried
from tests.models.remote.servers import free_port

CHECKOUTS, PYTHON = os.environ.get("VSNBENCH_UPSTREAM", ""), os.environ.get("VSNBENCH_UPSTREAM_PYTHON", "")
RUN = Path(__file__).with_name("run_upstream.py")
PATIENCE_S = 600.0
"""The servers load torch, and say nothing about speed here."""
pytestmark = [
    pytest.mark.timeout(5 * PATIENCE_S),
    pytest.mark.skipif(
        not CHECKOUTS or not PYTHON, reason="needs checkouts of the models' repositories and a Python for them"
    ),
]


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A directory with the adapters and the server file."""
    lay_out(tmp_path)
    (tmp_path / "vsnbench.toml").write_text(f"[models]\nact_timeout_s = {PATIENCE_S}\n", encoding="utf-8")
    return tmp_path


@contextmanager
def upstream(name: str, directory: Path) -> Iterator[str]:
    """Run one of upstream's servers; yield its address."""
    port, place = free_port(), directory / "upstream"
    lay_out(place)
    words = (str(RUN), name, CHECKOUTS, "--port", str(port))
    with process(*words, port=port, cwd=place, python=PYTHON, patience_s=PATIENCE_S):
        yield f"http://127.0.0.1:{port}"


@pytest.mark.parametrize(
    ("algo", "starts"),
    [("gnm", "5,6"), ("vint", "5,6"), ("nomad", "5,14")],  # NoMaD's random path from 6 ends at a wall
)
def test_two_episodes_with_a_photograph_end_alike(
    algo: str, starts: str, directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with upstream(algo, directory) as url:
        steps = driven("NavDP", directory, monkeypatch, capsys, timeout_s=PATIENCE_S, url=url, algo=algo, starts=starts)
    assert [action for action, _, _ in steps] == (["TRAJECTORY"] * 3 + ["STOP"]) * 2


@pytest.mark.parametrize("algo", ["iplanner", "viplanner"])
def test_a_planner_without_training_plans_on(
    algo: str, directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with upstream(algo, directory) as url:
        steps = driven(
            "NavDP",
            directory,
            monkeypatch,
            capsys,
            "free-point",
            "8",
            end="step_limit",
            timeout_s=PATIENCE_S,
            url=url,
            algo=algo,
        )
    assert {action for action, _, _ in steps} == {"TRAJECTORY"}


def test_ddppo_reaches_the_point_with_discrete_actions(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with upstream("ddppo", directory) as url:
        steps = driven(
            "NavDP", directory, monkeypatch, capsys, "free-point", "8", timeout_s=PATIENCE_S, url=url, algo="ddppo"
        )
    actions = [action for action, _, _ in steps]
    assert set(actions) == {"MOVE_FORWARD", "TURN_LEFT", "TURN_RIGHT", "STOP"}
    assert actions.count("MOVE_FORWARD") == 7


def test_streamvln_says_four_actions_for_an_image(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with upstream("streamvln", directory) as url:
        steps = driven("StreamVLN", directory, monkeypatch, capsys, timeout_s=PATIENCE_S, url=url)
    assert [action for action, _, _ in steps] == ["MOVE"] * 9 + ["STOP"]


def test_dualvln_says_actions_or_a_way(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with upstream("dualvln", directory) as url:
        steps = driven("DualVLN", directory, monkeypatch, capsys, timeout_s=PATIENCE_S, url=url)
    assert [action for action, _, _ in steps] == ["MOVE"] * 3 + ["TRAJECTORY"] * 6 + ["MOVE", "STOP"]


def test_unigoal_finds_what_the_photograph_shows_and_stops_there(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with upstream("unigoal", directory) as url:
        served = url.replace("http", "ws")
        steps = tried("UniGoal", served, directory, monkeypatch, capsys, starts="5,6")
    actions = [action for action, _, _ in steps]
    assert set(actions) <= {"MOVE_FORWARD", "TURN_LEFT", "TURN_RIGHT", "STOP"}
    assert actions.count("STOP") == 2
