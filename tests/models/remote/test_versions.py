"""Protocol version 2 sends the task; clients and servers of version 1 still work."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.sync.client import ClientConnection, connect
from websockets.sync.server import ServerConnection

from tests.models.remote.servers import CARD, STUB_OF_VERSION_1, look, scripted_server, stub_server
from vsnbench.errors import ModelError
from vsnbench.models.contract_check import synthetic_task
from vsnbench.models.fit.goal import misfit
from vsnbench.models.registry import create_policy
from vsnbench.models.remote.isolation import IsolatedPolicy, Isolation
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import _common_version, pack, unpack
from vsnbench.sites.site import load_site
from vsnbench.values.action import Action
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.movement import ActionKind, Waypoint
from vsnbench.values.observation import Budget, observation_of

ROOT = Path(__file__).resolve().parents[3]
TURNS = """
class Model:
    card = {"name": "turns", "sensors": ["rgb"]}

    def reset(self, goal, seed):
        self.goal = goal

    def act(self, observation):
        return {"action": "TURN_LEFT", "diagnostics": {"note": str(self.goal)}}
"""
TELLS_ITS_TASK = """
class Model:
    card = {"name": "told", "goal_kinds": ["category", "text", "image"], "action_kinds": ["discrete", "waypoint"]}

    def reset(self, goal, seed):
        raise AssertionError("begin is called instead")

    def begin(self, task):
        self.task = task

    def act(self, observation):
        task, budget = self.task, observation.budget
        details = {
            "goal": [str(task.goal), task.goal.id, task.goal.kind, task.goal.text, task.goal.category],
            "image": None if task.goal.image is None else int(task.goal.image.sum()),
            "protocol": vars(task.protocol),
            "robot": dict(vars(task.robot), camera=vars(task.robot.camera)),
            "budget": budget,
            "seed": task.seed,
        }
        return {"movement": {"kind": "waypoint", "x_m": 1.0, "y_m": 0.5}, "diagnostics": {"details": details}}
"""
IN_PROCESS = """
from vsnbench import Action, Decision, Diagnostics, ModelCard, Policy

class Model(Policy):
    card = ModelCard("told")

    def reset(self, goal, seed):
        raise AssertionError

    def begin(self, task):
        self.task = task

    def act(self, observation):
        return Decision(Action.STOP, diagnostics=Diagnostics(note=repr(self.task)))
"""


def test_a_server_of_version_1_runs_category_goals_with_discrete_actions(tmp_path: Path) -> None:
    with stub_server(TURNS, tmp_path, stub=STUB_OF_VERSION_1) as (url, _):
        policy = create_policy(url)
        policy.begin(synthetic_task(Goal("plant", category="potted plant"), 4))
        decision = policy.act(look())
    assert (decision.action, decision.diagnostics.note) == (Action.TURN_LEFT, "potted plant")
    assert policy.card.goal_kinds == {GoalKind.CATEGORY}
    assert policy.card.action_kinds == {ActionKind.DISCRETE}


def test_a_server_of_version_1_is_refused_a_goal_in_words(tmp_path: Path) -> None:
    with stub_server(TURNS, tmp_path, stub=STUB_OF_VERSION_1) as (url, _):
        policy = RemotePolicy(url)
        with pytest.raises(ModelError) as refused:
            policy.begin(synthetic_task(Goal("red", GoalKind.TEXT, text="the red chair"), 4))
    assert refused.value.code == "wrong-protocol-version"


@pytest.mark.parametrize("answer", [{"movement": {"kind": "waypoint", "x_m": 1, "y_m": 0}}, {"parts": ["STOP"]}])
def test_a_movement_from_a_server_of_version_1_is_an_error(answer: dict[str, Any]) -> None:
    seen: list[dict[str, Any]] = []

    def reply(connection: ServerConnection, message: dict[str, Any]) -> None:
        seen.append(message)
        kind: dict[str, Any] = {"type": "ready"} if message["type"] == "reset" else {"type": "decision", **answer}
        connection.send(pack({**kind, "seq": message["seq"], "action": "STOP"}))

    card = {**CARD, "action_kinds": ["waypoint"], "goal_kinds": ["text"]}
    with scripted_server(reply, {"type": "card", "wire": 1, "card": card, "jpeg": False}) as url:
        policy = RemotePolicy(url)
        assert "takes goals of kind category" in misfit(policy.card, site_with_text(), "words")
        policy.reset("chair", 0)
        with pytest.raises(ModelError) as refused:
            policy.act(observation_of(0.0, look().camera, rgb=look().rgb, budget=Budget(3)))
    assert refused.value.code == "wrong-protocol-version"
    assert set(seen[0]) == {"type", "seq", "episode", "goal", "seed"}
    assert set(seen[1]) == {"type", "seq", "stamp_s", "camera", "rgb", "depth", "pose"}


def site_with_text() -> Any:
    site = load_site("apartment")
    chair = next(thing for thing in site.objects if thing.category == "chair")
    goal = {"id": "words", "kind": "text", "text": "a chair", "targets": [{"object": chair.id}]}
    return type(site).model_validate({**site.model_dump(), "goals": [goal]})


@contextmanager
def old_client(url: str, **hello: Any) -> Iterator[tuple[ClientConnection, dict[str, Any]]]:
    """Connect like a client of version 1."""
    with connect(url, compression=None, proxy=None) as connection:
        connection.send(pack({"type": "hello", "wire": 1, "token": "", "client": "vsnbench 0.1.0", **hello}))
        yield connection, unpack(connection.recv())


def test_a_client_of_version_1_gets_version_1(tmp_path: Path) -> None:
    with stub_server(TURNS, tmp_path) as (url, _), old_client(url) as (connection, greeting):
        assert (greeting["type"], greeting["wire"], greeting["card"]["name"]) == ("card", 1, "turns")
        connection.send(pack({"type": "reset", "seq": 1, "episode": "x", "goal": "bed", "seed": 3}))
        assert unpack(connection.recv())["type"] == "ready"
        camera = look().camera.model_dump(mode="json")
        rgb = {"encoding": "raw", "height": 48, "width": 64, "data": look().rgb.tobytes()}
        act = {"type": "act", "seq": 2, "stamp_s": 0.0, "camera": camera, "rgb": rgb, "depth": None, "pose": None}
        connection.send(pack(act))
        answer = unpack(connection.recv())
        assert (answer["type"], answer["action"], answer["diagnostics"]["note"]) == ("decision", "TURN_LEFT", "bed")


def test_a_client_of_version_1_is_refused_a_model_of_movements(tmp_path: Path) -> None:
    with stub_server(TELLS_ITS_TASK, tmp_path) as (url, _), old_client(url) as (_connection, greeting):
        assert (greeting["type"], greeting["code"]) == ("error", "version")


@pytest.mark.parametrize(
    ("hello", "version"),
    [
        ({"wire": 1}, 1),
        ({"wire": 1, "newest_wire": 2}, 2),
        ({"wire": 1, "newest_wire": 7}, 2),
        ({"wire": 2}, 2),
        ({"wire": 3, "newest_wire": 4}, 0),
        ({"wire": 0}, 0),
        ({"wire": True, "newest_wire": 2}, 0),
        ({"wire": "1"}, 0),
        ({}, 0),
    ],
)
def test_both_sides_use_the_highest_version_that_both_know(hello: dict[str, Any], version: int) -> None:
    assert _common_version(hello) == version


def test_the_whole_task_reaches_the_server(tmp_path: Path) -> None:
    photo = np.full((6, 8, 3), 7, np.uint8)
    with stub_server(TELLS_ITS_TASK, tmp_path) as (url, _):
        policy = RemotePolicy(url)
        goals = (Goal("words", GoalKind.TEXT, text="the red chair"), Goal("seen", GoalKind.IMAGE, image=photo))
        details = []
        for goal in goals:
            policy.begin(task := synthetic_task(goal, 4_000_000_000))
            decision = policy.act(observation_of(0.0, look().camera, budget=Budget(17, None, 2.5)))
            assert decision.movement == Waypoint(1.0, 0.5)
            details.append(decision.diagnostics.details)
    words, image = details
    assert words["goal"] == ["the red chair", "words", "text", "the red chair", ""]
    assert (words["image"], image["image"]) == (None, 6 * 8 * 3 * 7)
    assert words["seed"] == 4_000_000_000
    assert words["budget"] == {"actions_left": 17, "time_left_s": None, "path_left_m": 2.5}
    protocol, robot = task.protocol, task.robot
    assert words["protocol"] == {name: getattr(protocol, name) for name in protocol.__dataclass_fields__}
    expected = {name: getattr(robot, name) for name in robot.__dataclass_fields__}
    assert words["robot"] == {**expected, "camera": robot.camera.model_dump(mode="json")}


def test_a_policy_in_its_own_process_receives_the_same_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "told_policy.py").write_text(IN_PROCESS)
    monkeypatch.chdir(tmp_path)
    task = synthetic_task(Goal("chair"), 5)
    policy = IsolatedPolicy("told_policy:Model", {}, Isolation())
    try:
        policy.begin(task)
        assert policy.act(look()).diagnostics.note == repr(task)
    finally:
        policy.close()


@pytest.mark.parametrize("task", [7, {}, {"protocol": {}}, {"protocol": {}, "robot": {}}, {"protocol": 1, "robot": 2}])
def test_a_task_that_is_none_is_refused_and_the_connection_stays(task: Any, tmp_path: Path) -> None:
    with stub_server(TURNS, tmp_path) as (url, _), old_client(url, newest_wire=2) as (connection, _greeting):
        reset = {"type": "reset", "seq": 1, "episode": "x", "goal": "bed", "seed": 3}
        connection.send(pack({**reset, "task": task}))
        answer = unpack(connection.recv())
        assert (answer["type"], answer["code"]) == ("error", "protocol")
        connection.send(pack({**reset, "seq": 2}))
        assert unpack(connection.recv())["type"] == "ready"
