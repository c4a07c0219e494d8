"""Both sides agree on a version of the protocol; the task reaches the server."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.sync.client import ClientConnection, connect

from tests.models.remote.servers import look, stub_server
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.remote import vsnbench_policy as wire
from vsnbench.models.remote.isolation import IsolatedPolicy, Isolation
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.reset_message import PROTOCOL_FIELDS, reset_message
from vsnbench.models.remote.serving import ServedPolicy
from vsnbench.models.remote.vsnbench_policy import _common_version, pack, unpack
from vsnbench.models.synthetic import synthetic_task
from vsnbench.models.task import Task
from vsnbench.values.decision import Decision
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.movement import Waypoint
from vsnbench.values.observation import Budget, Observation, observation_of

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


@contextmanager
def client(url: str) -> Iterator[tuple[ClientConnection, dict[str, Any]]]:
    with connect(url, compression=None, proxy=None) as connection:
        connection.send(pack({"type": "hello", "wire": 2, "token": "", "client": "test"}))
        yield connection, unpack(connection.recv())


@pytest.mark.parametrize(
    ("hello", "version"),
    [
        ({"wire": 1}, 0),
        ({"wire": 2}, 2),
        ({"wire": 1, "newest_wire": 2}, 2),
        ({"wire": 1, "newest_wire": 7}, 2),
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
    assert words["protocol"] == {name: getattr(protocol, name) for name in PROTOCOL_FIELDS}
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


def test_a_client_may_leave_out_limits_that_the_protocol_has_not() -> None:
    received = []

    class Keeping(Policy):
        card = ModelCard("keeping")

        def begin(self, task: Task) -> None:
            received.append(task)

        def reset(self, goal: str, seed: int) -> None: ...

        def act(self, observation: Observation) -> Decision:
            raise AssertionError("only the task is received")

    message = reset_message("chair", 0, synthetic_task("chair", 0))
    for name in ("max_time_s", "max_path_m"):
        del message["task"]["protocol"][name]
    del message["task"]["robot"]["max_lateral_m_s"]
    ServedPolicy(Keeping()).begin(wire.Task.of(wire.Goal.of(message), 0, message["task"]))
    assert received == [synthetic_task("chair", 0)]


@pytest.mark.parametrize("task", [7, {}, {"protocol": {}}, {"protocol": {}, "robot": {}}, {"protocol": 1, "robot": 2}])
def test_a_task_that_is_none_is_refused_and_the_connection_stays(task: Any, tmp_path: Path) -> None:
    with stub_server(TURNS, tmp_path) as (url, _), client(url) as (connection, _greeting):
        reset = {"type": "reset", "seq": 1, "episode": "x", "goal": "bed", "seed": 3}
        connection.send(pack({**reset, "task": task}))
        answer = unpack(connection.recv())
        assert (answer["type"], answer["code"]) == ("error", "protocol")
        connection.send(pack({**reset, "seq": 2}))
        assert unpack(connection.recv())["type"] == "ready"
