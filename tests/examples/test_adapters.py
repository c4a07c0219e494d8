"""The adapters run by the commands of their page, against stand-ins for the models' own code."""

import io
import json
import math
import runpy
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.examples.adapter_trials import (
    ADAPTERS,
    COMMANDS,
    UPSTREAM,
    VLFM,
    driven,
    lay_out,
    poses,
    process,
    served,
)
from tests.models.remote.servers import free_port
from vsnbench.models.remote.checking import check_server
from vsnbench.robots.registry import profile_of
from vsnbench.values.pose import Pose


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A directory with the adapters, the server file and stand-ins for the models' code."""
    lay_out(tmp_path, *UPSTREAM.iterdir())
    return tmp_path


@contextmanager
def navdp_server(directory: Path, algo: str = "navdp") -> Iterator[str]:
    port = free_port()
    with process("navdp_server.py", "--port", str(port), "--algo", algo, port=port, cwd=directory):
        yield f"http://127.0.0.1:{port}"


def test_the_page_has_commands_for_every_adapter() -> None:
    named = {serves.split()[1].partition(":")[0] for serves in COMMANDS}
    assert named == {file.stem for file in ADAPTERS.glob("*.py")}
    assert len(COMMANDS) == 9


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


@pytest.mark.parametrize("algo", ["gnm", "vint", "nomad"])
def test_servers_that_keep_images_forget_them_between_episodes(
    algo: str, directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with navdp_server(directory, algo) as url:
        steps = driven("NavDP", directory, monkeypatch, capsys, url=url, algo=algo, starts="5,6")
    assert [action for action, _, _ in steps] == (["TRAJECTORY"] * 4 + ["STOP"]) * 2


def test_a_route_goes_from_photograph_to_photograph(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with navdp_server(directory, "gnm") as url:
        steps = driven("NavDP", directory, monkeypatch, capsys, "to-the-armchair", "2", url=url, algo="gnm")
    assert [action for action, _, _ in steps] == ["TRAJECTORY"] * 12 + ["STOP"]


@pytest.mark.parametrize("algo", ["iplanner", "viplanner"])
def test_planners_that_never_stop_end_near_the_point(
    algo: str, directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with navdp_server(directory, algo) as url:
        steps = driven("NavDP", directory, monkeypatch, capsys, "free-point", "8", url=url, algo=algo)
    assert [action for action, _, _ in steps] == ["TRAJECTORY"] * (len(steps) - 1) + ["STOP"]
    assert float(steps[-1][1].split()[0]) < 0.5


def test_ddppo_turns_and_drives_discrete_steps_to_a_point(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with navdp_server(directory, "ddppo") as url:
        steps = driven("NavDP", directory, monkeypatch, capsys, "free-point", "8", url=url, algo="ddppo")
    actions = [action for action, _, _ in steps]
    assert set(actions) >= {"MOVE_FORWARD", "STOP"}
    assert set(actions) <= {"MOVE_FORWARD", "TURN_LEFT", "TURN_RIGHT", "STOP"}


def answering(trajectory: Any, **arguments: Any) -> Any:
    """Return the NavDP adapter with a server that always plans one trajectory."""
    module = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))
    module["NavDP"].urls.clear()
    model = module["NavDP"](**arguments)
    model.goals = [np.zeros((32, 32, 3), np.uint8)]
    model.posted = []

    def post(route: str, body: bytes, *_: Any) -> dict[str, Any]:
        model.posted.append((route, body))
        return {"trajectory": np.asarray(trajectory).tolist(), "all_values": [[-3.5]], "algo": model.algo}

    model._post = post
    return model


SEEN = SimpleNamespace(
    rgb=np.zeros((32, 32, 3), np.uint8), depth_m=np.full((32, 32), np.nan, np.float32), pose=Pose(1.0, 2.0, math.pi / 2)
)


def test_navdp_sends_red_and_blue_exchanged() -> None:
    module = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))
    red = np.zeros((32, 32, 3), np.uint8)
    red[..., 0] = 255
    received = np.asarray(Image.open(io.BytesIO(module["_jpeg"](red))))
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


def task(**goal: Any) -> Any:
    camera = SimpleNamespace(width=640, height=480, horizontal_fov_deg=60)
    goal = {"kind": "image", "image": SEEN.rgb, "images": (), "point": None} | goal
    return SimpleNamespace(goal=SimpleNamespace(**goal), robot=SimpleNamespace(camera=camera))


@pytest.mark.parametrize("algo", ["navdp", "gnm", "vint", "nomad", "iplanner", "viplanner", "ddppo"])
def test_a_server_of_another_model_is_refused_in_one_line(algo: str) -> None:
    model = answering(np.zeros((1, 24, 3)), algo=algo)
    model.begin(task())
    assert [route for route, _ in model.posted] == ["navigator_reset", "navigator_reset_env"]
    model._post = lambda *_: {"algo": "other"}
    with pytest.raises(ValueError, match=f"^the server at [^\n]* is that of 'other', not of '{algo}': [^\n]*$"):
        model.begin(task())


def test_a_mode_that_a_server_has_no_route_for_is_refused() -> None:
    with pytest.raises(ValueError, match="mode of gnm must be image or nogoal"):
        answering(np.zeros((1, 24, 3)), algo="gnm", mode="point")
    with pytest.raises(ValueError, match="algo must be one of navdp, gnm"):
        answering(np.zeros((1, 24, 3)), algo="rdp")


def test_a_point_reaches_the_server_in_the_robots_frame() -> None:
    ahead = np.zeros((1, 24, 3))
    ahead[0, :, 0] = np.linspace(0.0, 1.0, 24)
    model = answering(ahead, algo="iplanner")
    model.begin(task(kind="point", image=None, point=(0.0, 5.0)))
    points = model.act(SEEN)["movement"]["points"]
    assert points[0] != [0.0, 0.0]  # the wire takes no point at the robot itself
    body = model.posted[-1][1]
    goal = json.loads(body[body.index(b'{"goal_x"') : body.index(b"}", body.index(b'{"goal_x"')) + 1])
    assert (goal["goal_x"][0], goal["goal_y"][0]) == pytest.approx((3.0, 1.0))


def test_zeros_of_navdp_mean_a_turn_where_the_point_is_behind_the_robot() -> None:
    model = answering(np.zeros((1, 24, 3)), mode="point")
    model.begin(task(kind="point", image=None, point=(1.0, -3.0)))
    assert model.act(SEEN)["action"] in ("TURN_LEFT", "TURN_RIGHT")
    model.begin(task(kind="point", image=None, point=(1.0, 2.2)))
    assert model.act(SEEN)["action"] == "STOP"


def test_a_navdp_server_that_is_not_there_is_one_line() -> None:
    model = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))["NavDP"](url=f"http://127.0.0.1:{free_port()}")
    with pytest.raises(RuntimeError, match=r"navigator_reset: .*refused"):
        model.begin(task())


def test_navdps_server_is_not_shared_between_sessions() -> None:
    model = runpy.run_path(str(ADAPTERS / "navdp_adapter.py"))["NavDP"]
    model()
    model("http://127.0.0.1:8889")
    with pytest.raises(ValueError, match="serve one session"):
        model()


@contextmanager
def vln_server(directory: Path) -> Iterator[str]:
    port = free_port()
    with process("vln_server.py", "--port", str(port), port=port, cwd=directory):
        yield f"http://127.0.0.1:{port}"


def test_streamvln_executes_four_actions_in_upstreams_sizes(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with vln_server(directory) as url:
        steps = driven("StreamVLN", directory, monkeypatch, capsys, url=url)
    assert [action for action, _, _ in steps] == ["MOVE"] * 7 + ["STOP"]
    turns = [round(math.degrees(moved.get("turn_rad", 0))) for _, _, moved in steps[:7] if moved]
    assert turns == [0, 15, 0, -15, -15, 0, 0]


def test_dualvln_executes_actions_and_trajectories_and_does_not_look_down(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with vln_server(directory) as url:
        steps = driven("DualVLN", directory, monkeypatch, capsys, url=url)
    expected = ["MOVE"] * 3 + ["TRAJECTORY"] * 2 + ["NOOP"] + ["MOVE"] * 2 + ["STOP"]
    assert [action for action, _, _ in steps] == expected
    assert [moved["points"][-1][0] for _, _, moved in steps if moved and "points" in moved] == pytest.approx([0.25] * 2)


def test_the_vln_servers_get_the_instruction_and_upstreams_order_of_colours() -> None:
    module = streamvln_module()
    for name, is_red_first in (("StreamVLN", False), ("DualVLN", True)):
        posted = []
        module["ask_of"](posted, {"action": [0], "discrete_action": [0]})
        model = module[name]()
        model.reset(SimpleNamespace(kind="category", text=""), 0)
        red = np.zeros((32, 32, 3), np.uint8)
        red[..., 0] = 255
        seen = SimpleNamespace(rgb=red, depth_m=SEEN.depth_m)
        assert model.act(seen)["action"] == "STOP"
        model.act(seen)
        assert [b'"reset": true' in body for body in posted] == [True, False]
        assert all(b"Search for a" in body for body in posted)
        start = posted[0].index(b"\xff\xd8")
        received = np.asarray(Image.open(io.BytesIO(posted[0][start:])))
        assert (received[..., 0].mean() > received[..., 2].mean()) == is_red_first


def test_an_answer_of_a_vln_server_that_is_no_step_is_refused() -> None:
    model = streamvln_module()["StreamVLN"]()
    with pytest.raises(ValueError, match="streamvln answered with 7, which is no step"):
        model.steps([1, 7])


def streamvln_module() -> dict[str, Any]:
    """Return the adapter's module with `ask_of`, which replaces the server by one answer and keeps what it is sent."""
    navdp = ModuleType("navdp_adapter")
    vars(navdp).update(runpy.run_path(str(ADAPTERS / "navdp_adapter.py")))
    sys.modules["navdp_adapter"] = navdp
    try:
        module = runpy.run_path(str(ADAPTERS / "streamvln_adapter.py"))
    finally:
        del sys.modules["navdp_adapter"]

    def ask_of(posted: list[bytes], answer: dict[str, Any]) -> None:
        module["_Server"].urls.clear()
        module["_Server"].ask.__globals__["post"] = lambda url, body, *_: posted.append(body) or answer

    module["ask_of"] = ask_of
    return module


def test_goats_agent_keeps_its_memory_from_goal_to_goal(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    torch = pytest.importorskip("torch")
    torch.save({"state_dict": {"actor_critic.net.goat_embeeding.weight": torch.zeros(1)}}, directory / "ckpt.pth")
    steps = driven("SenseActNN", directory, monkeypatch, capsys, device="cpu")
    legs = [["MOVE_FORWARD"] * goals + ["NOOP", "STOP"] for goals in range(1, 6)]
    assert [action for action, _, _ in steps] == [action for leg in legs for action in leg]
    assert {raw for _, raw, _ in steps} == {"move_forward", "look_up", "subtask_stop"}


def test_unigoals_program_owns_the_loop_of_each_episode(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = driven("UniGoal", directory, monkeypatch, capsys, starts="5,6")
    assert [action for action, _, _ in steps] == (["TURN_LEFT"] * 2 + ["MOVE_FORWARD"] * 3 + ["STOP"]) * 2


def test_an_episode_of_unigoal_that_ends_without_stop_leaves_room_for_the_next(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = driven("UniGoal", directory, monkeypatch, capsys, "red-chairs", "5,14", end="step_limit")
    assert [action for action, _, _ in steps] == (["TURN_LEFT"] * 2 + ["MOVE_FORWARD"] * 22) * 2


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
