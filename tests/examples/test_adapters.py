"""The adapters run by the commands of their page, against stand-ins for the models' own code."""

import json
import math
import re
import runpy
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.cli.console import vsnbench
from tests.models.remote.servers import PATIENCE_S, STUB, await_port, free_port
from vsnbench.models.remote.checking import check_server
from vsnbench.robots.registry import profile_of
from vsnbench.values.pose import Pose

ROOT = Path(__file__).resolve().parents[2]
ADAPTERS = ROOT / "examples" / "adapters"
UPSTREAM = Path(__file__).resolve().parent / "upstream"
PAGE = (ADAPTERS / "README.md").read_text(encoding="utf-8")
COMMANDS = dict(re.findall(r"^python (vsnbench_policy\.py \w+:(?:\w+).*)\n(vsnbench run .*)$", PAGE, re.MULTILINE))
VLFM = {"pointnav_policy_path": "data/pointnav_weights.pth", "depth_image_shape": [224, 224], "text_prompt": "a chair"}
SETTINGS = {
    "uninavid.json": {"model_path": "model_zoo/uninavid"},
    "navila.json": {"model_path": "navila-llama3-8b-8f", "question_file": "question.txt"},
    "vlfm.json": {"arguments": VLFM, "device": "cpu"},
}


@contextmanager
def process(*command: str, port: int, cwd: Path) -> Iterator[None]:
    with (cwd / "server.log").open("ab") as log:
        started = subprocess.Popen([sys.executable, *command], cwd=cwd, stderr=log, stdout=log)
    try:
        await_port(port, started)
        yield
    finally:
        started.kill()
        started.wait(PATIENCE_S)


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A directory with the adapters, the server file and the models' code."""
    for folder in (ADAPTERS, *UPSTREAM.iterdir()):
        shutil.copytree(folder, tmp_path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / STUB.name).write_bytes(STUB.read_bytes())
    (tmp_path / "question.txt").write_text("Seen: {frames} Now: <image>\nTask: {instruction}")
    for name, settings in SETTINGS.items():
        (tmp_path / name).write_text(json.dumps(settings))
    return tmp_path


@contextmanager
def served(model: str, directory: Path, **settings: Any) -> Iterator[str]:
    """Serve a model with the command of the page; yield its address."""
    serves = next(serves for serves in COMMANDS if f":{model} " in serves)
    port = free_port()
    words = [*serves.replace("--port 8765", "").split(), "--port", str(port)]
    if settings:
        file = (
            directory / words[words.index("--settings") + 1] if "--settings" in words else directory / "settings.json"
        )
        kept = json.loads(file.read_text()) if file.exists() else {}
        file.write_text(json.dumps(kept | settings))
        words += [] if "--settings" in words else ["--settings", file.name]
    with process(*words, port=port, cwd=directory):
        yield f"ws://127.0.0.1:{port}"


@contextmanager
def navdp_server(directory: Path) -> Iterator[str]:
    port = free_port()
    with process("navdp_server.py", "--port", str(port), port=port, cwd=directory):
        yield f"http://127.0.0.1:{port}"


def driven(
    model: str, directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], **settings: Any
) -> list[tuple[str, str, dict[str, Any] | None]]:
    """Serve a model and run one trial, as the page does; return action, raw action and movement of each step."""
    runs = next(runs for serves, runs in COMMANDS.items() if f":{model} " in serves)
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("VSNBENCH_ROBOT", "simulated:turtlebot2@160x120")
    with served(model, directory, **settings) as url:
        arguments = runs.replace("ws://127.0.0.1:8765", url).split()[1:]
        answer = vsnbench(
            monkeypatch,
            capsys,
            *arguments,
            "--starts",
            "5",
            "--max-steps",
            "24",
            "--results",
            str(directory / "results"),
        )
    assert answer.code == 0, answer.err + (directory / "server.log").read_text()
    with closing(sqlite3.connect(directory / "results" / "vsnbench.db")) as database:
        rows = database.execute("SELECT action, raw_action, movement FROM step ORDER BY number").fetchall()
        (reason,) = database.execute("SELECT end_reason FROM episode").fetchone()
    assert reason == "stop", (directory / "server.log").read_text()
    return [(action, raw, json.loads(movement) if movement else None) for action, raw, movement in rows]


def poses(directory: Path) -> list[Pose]:
    """Return the poses of the trial relative to its start: at the start, and after each step."""
    with closing(sqlite3.connect(directory / "results" / "vsnbench.db")) as database:
        rows = database.execute("SELECT after_x_m, after_y_m, after_heading_rad FROM step ORDER BY number").fetchall()
    return [Pose(0.0, 0.0, 0.0), *(Pose(*row) for row in rows)]


def test_the_page_has_commands_for_every_adapter() -> None:
    named = {serves.split()[1].partition(":")[0] for serves in COMMANDS}
    assert named == {file.stem for file in ADAPTERS.glob("*.py")}
    assert len(COMMANDS) == 5


@pytest.mark.parametrize("model", ["NavDP", "UniNaVid", "NaVILA", "VLFMHabitat", "VLFMReality"])
def test_the_adapters_pass_models_check_and_state_their_camera(model: str, directory: Path) -> None:
    with (
        navdp_server(directory) as navdp,
        served(model, directory, **({"url": navdp} if model == "NavDP" else {})) as url,
    ):
        findings = {finding.what: finding for finding in check_server(url, profile=profile_of("turtlebot2"))}
    assert [finding for finding in findings.values() if not finding.passed] == [], (
        directory / "server.log"
    ).read_text()
    assert "states no camera" not in findings["camera"].seen


def test_navdp_drives_a_metre_at_a_time_and_stops_where_the_server_zeroes_its_trajectory(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with navdp_server(directory) as url:
        steps = driven("NavDP", directory, monkeypatch, capsys, url=url)
    assert len(steps) == 5
    assert steps[-1][:2] == ("STOP", "0.00 m")
    lengths = [moved["points"][-1][0] for action, _, moved in steps if action == "TRAJECTORY" and moved]
    assert lengths
    assert all(1.0 <= length < 1.1 for length in lengths)


def answering(trajectory: Any, **arguments: Any) -> Any:
    """Return the NavDP adapter with a server that always plans one trajectory."""
    module = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))
    module["NavDP"].urls.clear()
    model = module["NavDP"](**arguments)
    model.goal = np.zeros((32, 32, 3), np.uint8)
    model._post = lambda *_: {"trajectory": np.asarray(trajectory).tolist(), "all_values": [[-3.5]]}
    return model


SEEN = SimpleNamespace(rgb=np.zeros((32, 32, 3), np.uint8), depth_m=np.full((32, 32), np.nan, np.float32))


def test_navdp_sends_red_and_blue_exchanged() -> None:
    module = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))
    from PIL import Image

    red = np.zeros((32, 32, 3), np.uint8)
    red[..., 0] = 255
    received = np.asarray(Image.open(__import__("io").BytesIO(module["_jpeg"](red))))
    assert received[..., 2].min() > 240 > 10 > received[..., 0].max()


@pytest.mark.parametrize("mode", ["image", "nogoal"])
@pytest.mark.parametrize(("side", "action"), [(-1.0, "TURN_RIGHT"), (1.0, "TURN_LEFT")])
def test_navdp_turns_where_its_critic_refuses(mode: str, side: float, action: str) -> None:
    turning = np.zeros((1, 24, 3))
    turning[..., 1] = side
    assert answering(turning, mode=mode).act(SEEN)["action"] == action


def test_navdp_turns_by_a_waypoint_where_the_robot_drives_on() -> None:
    turning = np.zeros((1, 24, 3))
    turning[..., 1] = -1.0
    model = answering(turning, turns="waypoint")
    assert model.card["action_kinds"] == ["discrete", "trajectory", "waypoint"]
    assert model.act(SEEN)["movement"]["heading_rad"] == pytest.approx(-math.pi / 6)
    assert "turns" not in model.card["settings"]


def test_a_zero_trajectory_of_an_image_goal_means_stop() -> None:
    zeroed = np.zeros((1, 24, 3))
    zeroed[..., 2] = 0.3  # upstream keeps the headings
    assert answering(zeroed).act(SEEN)["action"] == "STOP"
    assert answering(zeroed, mode="nogoal").act(SEEN)["action"] != "STOP"


def test_navdp_asks_its_server_for_the_threshold_of_upstreams_evaluations() -> None:
    assert answering(np.zeros((1, 24, 3))).card["settings"]["stop_threshold"] == -3.0


def test_a_navdp_answer_without_a_trajectory_is_refused() -> None:
    with pytest.raises(ValueError, match="no trajectory"):
        answering([[[0.1, 0.0, 0.0]]]).act(SEEN)


def test_a_server_of_another_model_is_not_taken_for_navdps() -> None:
    camera = SimpleNamespace(width=640, height=480, horizontal_fov_deg=60)
    model = answering(np.zeros((1, 24, 3)))
    model._post = lambda *_: {"algo": "vint"}
    with pytest.raises(ValueError, match="'vint', not of NavDP"):
        model.begin(SimpleNamespace(goal=SimpleNamespace(image=None), robot=SimpleNamespace(camera=camera)))


def test_a_navdp_server_that_is_not_there_is_one_line() -> None:
    model = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))["NavDP"](url=f"http://127.0.0.1:{free_port()}")
    camera = SimpleNamespace(width=640, height=480, horizontal_fov_deg=60)
    with pytest.raises(RuntimeError, match=r"navigator_reset: .*refused"):
        model.begin(SimpleNamespace(goal=SimpleNamespace(image=None), robot=SimpleNamespace(camera=camera)))


def test_navdps_server_is_not_shared_between_sessions() -> None:
    model = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))["NavDP"]
    model()
    model("http://127.0.0.1:8889")
    with pytest.raises(ValueError, match="serve one session"):
        model()


@pytest.mark.parametrize("chunk", [False, True])
def test_uninavid_executes_predicted_actions(
    chunk: bool, directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = driven("UniNaVid", directory, monkeypatch, capsys, chunk=chunk, at_once=4)
    assert [action for action, _, _ in steps] == ["MOVE_FORWARD", "TURN_LEFT", "MOVE_FORWARD", "TURN_RIGHT"] * 2 + [
        "STOP"
    ]


@pytest.mark.parametrize("chunk", [False, True])
def test_navila_drives_as_far_as_its_answers_say(
    chunk: bool, directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = driven("NaVILA", directory, monkeypatch, capsys, chunk=chunk)
    moves = [moved for action, _, moved in steps if action == "MOVE" and moved]
    assert steps[-1][0] == "STOP"
    assert [round(math.degrees(moved["turn_rad"])) for moved in moves if moved.get("turn_rad")] == [
        15,
        15,
        15,
        -15,
        -15,
    ]
    assert [moved["distance_m"] for moved in moves if moved.get("distance_m")] == [0.25] * 3


def test_navila_reads_odd_answers() -> None:
    steps_of = runpy.run_path(str(ADAPTERS / "navila_adapter.py"))["steps_of"]
    assert [step["movement"]["distance_m"] for step in steps_of("Move forward 60 cm")] == [0.25, 0.25, 0.1]
    assert steps_of("Stop.") == ["STOP"]
    assert steps_of("The next action is move forward 25 cm and stop.") == ["STOP"]
    with pytest.raises(ValueError, match="NaVILA's answer has no action"):
        steps_of("I see a sofa.")


@pytest.mark.parametrize(
    ("text", "step"),
    [
        ("The next action is move forward.", {"distance_m": 0.25}),
        ("move forward 0 cm", {"distance_m": 0.25}),
        ("The next action is turn left", {"turn_rad": math.radians(15)}),
        ("turn right a bit", {"turn_rad": -math.radians(15)}),
    ],
)
def test_an_answer_of_navila_without_a_number_is_one_step(text: str, step: dict[str, float]) -> None:
    steps_of = runpy.run_path(str(ADAPTERS / "navila_adapter.py"))["steps_of"]
    assert steps_of(text) == [{"movement": {"kind": "move", **step}}]


def test_navila_shows_the_latest_frame_last_and_pads_in_front() -> None:
    from PIL import Image

    sampled = runpy.run_path(str(ADAPTERS / "navila_adapter.py"))["sampled"]
    frames = [Image.new("RGB", (2, 2), (number, 0, 0)) for number in range(1, 21)]
    reds = [image.getpixel((0, 0))[0] for image in sampled(frames, 8)]
    assert len(reds) == 8
    assert reds[-1] == 20
    assert reds == sorted(reds)
    assert [image.getpixel((0, 0))[0] for image in sampled(frames[:2], 8)] == [0] * 6 + [1, 2]


def test_vlfms_habitat_policy_drives_discrete_actions(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = driven("VLFMHabitat", directory, monkeypatch, capsys)
    assert [action for action, _, _ in steps] == ["TURN_LEFT"] * 12 + ["MOVE_FORWARD"] * 2 + ["STOP"]


def test_vlfms_habitat_policy_refuses_a_goal_without_a_number() -> None:
    model = runpy.run_path(str(ADAPTERS / "vlfm_adapter.py"))["VLFMHabitat"](VLFM, device="cpu")
    with pytest.raises(ValueError, match="does not know 'table'; it knows chair, bed"):
        model.begin(SimpleNamespace(goal="table", seed=0))


def test_vlfms_real_robot_policy_turns_the_base_for_the_arm_and_drives_to_its_sub_goal(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = driven("VLFMReality", directory, monkeypatch, capsys)
    turns = [round(math.degrees(moved["turn_rad"])) for action, _, moved in steps if action == "MOVE" and moved]
    assert turns == [-90, 30, 30, 30, 30, 30, 30, -90]
    ways = [moved for action, _, moved in steps if action == "WAYPOINT" and moved]
    assert ways
    assert all(math.hypot(way["x_m"], way["y_m"]) == pytest.approx(0.21) for way in ways)
    towards = math.atan2(0.6, 1.5)
    assert ways[0]["heading_rad"] == pytest.approx(towards, abs=0.02)
    assert all(abs(way["heading_rad"]) < 0.05 for way in ways[1:])
    assert steps[-1][0] == "STOP"
    assert 0.69 <= poses(directory)[-1].distance_to(Pose(1.5, 0.6, 0.0)) < 0.9  # upstream's radius to stop is 0.9 m


@pytest.mark.parametrize(("horizon_m", "length_m"), [(0.5, 0.5), (None, 1.2), (3.0, 1.2)])
def test_vlfms_horizon_ends_the_way_to_a_sub_goal(horizon_m: float | None, length_m: float) -> None:
    model = runpy.run_path(str(ADAPTERS / "vlfm_adapter.py"))["VLFMReality"](VLFM, horizon_m=horizon_m)
    answer = model._towards(1.2, 2.0, Pose(1.0, 1.0, -2.0), "")
    way = answer["movement"]
    assert answer["diagnostics"]["sub_goal"] == pytest.approx((2.2, 1.0))
    assert (way["x_m"], way["y_m"]) == pytest.approx((length_m * math.cos(2.0), length_m * math.sin(2.0)))


def test_vlfms_displacements_without_a_sub_goal_are_upstreams(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    policy = "vlfm.policy.reality_policies:WithoutSubGoals"
    steps = driven("VLFMReality", directory, monkeypatch, capsys, policy_class=policy)
    assert [action for action, _, _ in steps[8:]] == ["WAYPOINT", "MOVE", "WAYPOINT", "STOP"]
    # vlfm/reality/pointnav_env.py:107-121: clipped to 1, times 20 cm and 30 degrees; then at once to that pose.
    expected = [(0.2, 0.3 * 30), (0.0, -0.5 * 30), (0.05, 30)]
    before = poses(directory)[8:-2]
    for pose, after, (metres, degrees) in zip(before, poses(directory)[9:-1], expected, strict=True):
        way = after.relative_to(pose)
        assert (way.x_m, way.y_m) == pytest.approx((metres, 0.0), abs=0.01)
        assert math.degrees(way.heading_rad) == pytest.approx(degrees, abs=0.5)
