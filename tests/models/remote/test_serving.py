"""Served built-in models return bit-identical decisions to local ones."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import torch

from tests.models.pirlnav.conftest import DATA
from tests.models.remote.servers import PATIENCE_S, await_port, free_port, look
from tests.processes import has_ended, wait_until
from vsnbench.errors import ModelError, ModelLostError, UsageError
from vsnbench.models.identity import code_of, files_handed_over
from vsnbench.models.registry import create_policy
from vsnbench.models.remote import connection
from vsnbench.models.remote.isolation import IsolatedPolicy, Isolation
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.serving import ServedPolicy
from vsnbench.results.writing.campaigns import content_sha256
from vsnbench.values.camera import Camera
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

ROOT = Path(__file__).resolve().parents[3]
SETTINGS = "runtime: torch\ndecision: sampled\n"
CAMERA = Camera(width=640, height=480, horizontal_fov_deg=79, mount_height_m=0.88)


@contextmanager
def served(*arguments: str, cwd: Path) -> Iterator[str]:
    port = free_port()
    command = [sys.executable, "-m", "vsnbench.cli.main", "models", "serve", *arguments, "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}  # the last bits depend on it
    with (cwd / "server.log").open("wb") as log:
        process = subprocess.Popen(command, cwd=cwd, env=environment, stderr=log)
    try:
        await_port(port, process)
        yield f"ws://127.0.0.1:{port}"
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(PATIENCE_S)


def test_pirlnav_elsewhere_gives_the_same_logits_and_actions_to_the_bit(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    weights = DATA / "ckpt.pth"
    settings = tmp_path / "pirlnav.yaml"
    settings.write_text(SETTINGS)
    frames = np.random.default_rng(3).integers(0, 256, (12, 480, 640, 3), np.uint8)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    request.addfinalizer(lambda: torch.set_num_threads(threads))
    here = create_policy("pirlnav", weights=weights, model_config=settings, device="cpu")
    arguments = ("pirlnav", "--weights", str(weights), "--model-config", str(settings), "--device", "cpu")
    with served(*arguments, cwd=tmp_path) as url:
        there = create_policy(url)
        assert there.card == here.card
        assert there.card.runs_on["runtime"] == "torch"
        assert there.card.runs_on["device"] == "cpu"
        for number, frame in enumerate(frames):
            if number % 6 == 0:
                here.reset("chair", number)
                there.reset("chair", number)
            seen = Observation(frame, None, Pose(0.1 * number, -0.05 * number, 0.2 * number), float(number), CAMERA)
            expected, answered = here.act(seen), there.act(seen)
            assert answered.action is expected.action
            assert answered.raw_action == expected.raw_action
            assert answered.diagnostics.details["logits"] == expected.diagnostics.details["logits"]
            assert answered.diagnostics.probabilities == expected.diagnostics.probabilities


def test_an_upper_bound_and_a_model_that_needs_labels_are_not_served() -> None:
    for name in ("oracle", "vlv"):
        with pytest.raises(UsageError) as refused:
            ServedPolicy(create_policy(name))
        assert refused.value.code == "cannot-be-served"


CRASHES = """
import os
import signal
import time

class Model:
    card = {"name": "crashes", "sensors": ["rgb"]}

    def reset(self, goal, seed):
        self.seed = seed

    def act(self, observation):
        if self.seed == 1:
            os._exit(3)
        if self.seed == 2:
            self.hoard = [bytearray(1 << 26) for _ in range(64)]
        if self.seed == 3:
            signal.raise_signal(signal.SIGSEGV)
        if self.seed == 4:
            time.sleep(3600)
        return "TURN_RIGHT"
"""


@pytest.fixture
def models_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "crashing.py").write_text(CRASHES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def isolated(memory_bytes: int | None = None, **options: Any) -> IsolatedPolicy:
    return IsolatedPolicy("crashing:Model", options, Isolation(Path(sys.executable), memory_bytes))


@pytest.mark.parametrize(("seed", "how"), [(1, "exit code 3"), (3, "SIGSEGV"), (4, r"no answer .* within 0\.5 s")])
def test_an_isolated_model_that_dies_or_hangs_is_lost_and_started_again(
    models_directory: Path, seed: int, how: str
) -> None:
    policy = isolated()
    policy.limit_actions(0.5)
    try:
        first = policy.pid
        policy.reset("chair", 0)
        policy.act(look())  # a connection's first action has the time of `reset`
        policy.reset("chair", seed)
        with pytest.raises(ModelLostError, match=f"act: .*{how}") as lost:
            policy.act(look())
        assert "listens" not in str(lost.value)
        policy.reset("chair", 0)
        assert policy.act(look()).action.value == "TURN_RIGHT"
        with pytest.raises(ProcessLookupError):
            os.kill(first, 0)
    finally:
        policy.close()


def test_an_isolated_model_that_comes_back_as_another_is_lost(models_directory: Path) -> None:
    policy = isolated()
    try:
        policy.reset("chair", 1)
        with pytest.raises(ModelLostError):
            policy.act(look())
        (models_directory / "crashing.py").write_text(CRASHES.replace('"crashes"', '"mended"'))
        with pytest.raises(ModelLostError, match=r"'crashes' → 'mended'"):
            policy.reset("chair", 0)
    finally:
        policy.close()


def test_an_isolated_model_has_the_memory_it_was_given_and_no_more(models_directory: Path) -> None:
    policy = isolated(memory_bytes=2 << 30)
    try:
        policy.reset("chair", 2)
        with pytest.raises(ModelError, match="MemoryError"):
            policy.act(look())
        policy.reset("chair", 0)
        assert policy.act(look()).action.value == "TURN_RIGHT"
    finally:
        policy.close()


def test_an_isolated_process_ends_with_its_policy(models_directory: Path) -> None:
    policy = isolated()
    pid = policy.pid
    policy.close()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


HOSTILE = """
import ctypes
import os
import subprocess
import sys

class Unreadable(Exception):
    def __str__(self):
        sys.exit(3)

class Model:
    card = {"name": "hostile", "sensors": ["rgb"]}

    def reset(self, goal, seed):
        self.goal = goal

    def act(self, observation):
        return {"action": "STOP", "raw_action": getattr(self, self.goal)()}

    def exit(self):
        sys.exit(0)

    def unreadable(self):
        raise Unreadable

    def parent(self):
        found = []
        for name in ("mem", "maps", "environ"):
            try:
                with open(f"/proc/{os.getppid()}/{name}", "rb"):
                    found.append(name)
            except OSError:
                pass
        return ",".join(found) or "nothing"

    def capabilities(self):
        with open("/proc/self/status") as file:
            return next(line.split()[1] for line in file if line.startswith("CapEff"))

    def leaves(self):
        return str(subprocess.Popen(["sleep", "600"], start_new_session=True).pid)
"""
FILE_CAPABILITIES = 0b11111


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[IsolatedPolicy]:
    (tmp_path / "hostile.py").write_text(HOSTILE)
    monkeypatch.chdir(tmp_path)
    policy = IsolatedPolicy("hostile:Model", {}, Isolation(Path(sys.executable)))
    yield policy
    policy.close()


def test_an_isolated_models_exit_and_unreadable_error_are_its_errors(hostile: IsolatedPolicy) -> None:
    hostile.reset("exit", 1)
    with pytest.raises(ModelError, match="SystemExit: 0"):
        hostile.act(look())
    hostile.reset("unreadable", 1)
    with pytest.raises(ModelError, match=r"Unreadable \(its message cannot be read\)"):
        hostile.act(look())


def test_an_isolated_model_cannot_read_the_runs_memory_even_as_root(hostile: IsolatedPolicy) -> None:
    hostile.reset("parent", 1)
    assert hostile.act(look()).raw_action == "nothing"
    hostile.reset("capabilities", 1)
    assert int(hostile.act(look()).raw_action, 16) & ~FILE_CAPABILITIES == 0


def test_what_an_isolated_model_has_started_ends_with_it(hostile: IsolatedPolicy) -> None:
    hostile.reset("leaves", 1)
    left = psutil.Process(int(hostile.act(look()).raw_action))
    assert not has_ended(left)
    hostile.close()
    wait_until(lambda: has_ended(left), "the model's own process ends")


def test_an_isolated_model_starts_with_a_token_in_the_environment_and_does_not_receive_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "hostile.py").write_text(
        HOSTILE + "\n    def token(self):\n        return os.environ.get('VSNBENCH_TOKEN', 'none')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("VSNBENCH_TOKEN", "of the lab")
    policy = IsolatedPolicy("hostile:Model", {}, Isolation(Path(sys.executable)))
    try:
        policy.reset("token", 1)
        assert policy.act(look()).raw_action == "none"
    finally:
        policy.close()


def test_a_card_that_is_refused_is_not_blamed_on_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "old.py").write_text(HOSTILE.replace('"name"', '"goal_kinds": ["image"], "name"'))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(connection, "MODEL", replace(connection.MODEL, versions=(2, 1)))
    with pytest.raises(ModelError) as refused:
        IsolatedPolicy("old:Model", {}, Isolation(Path(sys.executable)))
    assert refused.value.code == "refused"
    assert "pip" not in refused.value.advice


def test_an_interpreter_that_does_not_exist_is_refused() -> None:
    with pytest.raises(UsageError, match="no interpreter"):
        IsolatedPolicy("crashing:Model", {}, Isolation(Path("/nowhere/python")))


def test_a_model_that_cannot_start_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelError, match="No module named 'absent'"):
        IsolatedPolicy("absent:Model", {}, Isolation(Path(sys.executable)))


def test_the_stub_is_written_out_whole(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "vsnbench.cli.main", "models", "serve", "--write-stub", str(tmp_path / "mine")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run(command, check=True, env=environment, cwd=tmp_path, timeout=60, capture_output=True)
    from vsnbench.models.remote import vsnbench_policy

    assert (tmp_path / "mine" / "vsnbench_policy.py").read_bytes() == Path(vsnbench_policy.__file__).read_bytes()


AGENT = """
import numpy as np

class Agent:
    def __init__(self, turns=3):
        self.turns = turns

    def reset(self):
        self.count = 0

    def act(self, observations):
        assert observations["rgb"].dtype == np.uint8
        assert observations["depth"].shape == observations["rgb"].shape[:2] + (1,)
        assert 0 <= observations["depth"].min() and observations["depth"].max() <= 1
        assert observations["gps"].dtype == np.float32
        np.testing.assert_allclose(observations["gps"], [1.0, 0.5])
        np.testing.assert_allclose(observations["compass"], [0.25])
        assert observations["objectgoal"].tolist() == [5]
        self.count += 1
        return {"action": np.int64(0 if self.count > self.turns else 2)}
"""


@pytest.mark.parametrize("settings", ["settings.json", '{"name": "mine", "arguments": {"turns": 2}}'])
def test_a_habitat_agent_runs_unchanged(tmp_path: Path, settings: str) -> None:
    from tests.models.remote.servers import stub_server

    (tmp_path / "settings.json").write_text('{"name": "mine", "arguments": {"turns": 2}}')
    arguments = ("--habitat-agent", "served_model:Agent", "--settings", settings)
    with stub_server(AGENT, tmp_path, *arguments) as (url, _):
        policy = RemotePolicy(url)
        assert policy.card.name == "mine"
        assert policy.card.goals == {"chair", "bed", "plant", "toilet", "monitor", "sofa"}
        policy.reset("sofa", 7)
        assert [policy.act(look()).raw_action for _ in range(3)] == ["2", "2", "0"]
        assert policy.act(look()).action.value == "STOP"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ("absent.json", "No such file or directory: 'absent.json'"),
        ('{"name": }', "not valid JSON: Expecting value: line 1 column 10"),
        (__file__, "not valid JSON: "),
        ("list.json", "not a JSON object"),
    ],
)
def test_settings_that_cannot_be_read_are_one_line(
    settings: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from vsnbench.models.remote.vsnbench_policy import main

    monkeypatch.chdir(tmp_path)
    Path("list.json").write_text("[1]")
    with pytest.raises(SystemExit) as ended:
        main(["served_model:Model", "--settings", settings])
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 1
    assert said in line


def test_other_code_in_another_python_is_another_model(models_directory: Path) -> None:
    first = isolated()
    first.close()
    (models_directory / "crashing.py").write_text(CRASHES.replace("TURN_RIGHT", "TURN_LEFT"))
    second = isolated()
    second.close()
    assert first.card.code["class"] == second.card.code["class"] == "crashing:Model"
    assert first.card.code["sha256"] != second.card.code["sha256"]


OURS = """
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.values.movement import Action
from vsnbench.values.decision import Decision

class Walker(Policy):
    card = ModelCard("walker", settings={"pace": (1, 2)}, runs_on={"device": "abacus"})

    def __init__(self, weights=None):
        pass

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return Decision(Action.TURN_LEFT)
"""


@pytest.mark.parametrize("python", [None, Path(sys.executable)])
def test_the_same_source_is_the_same_model_in_this_process_and_in_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, python: Path | None
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "walking", raising=False)
    (tmp_path / "walking.py").write_text(OURS)
    (tmp_path / "walker.bin").write_bytes(b"steps")
    options = {} if python else {"weights": tmp_path / "walker.bin"}
    here = create_policy("walking:Walker", None, **options)
    there = create_policy("walking:Walker", Isolation(python), **options)
    there.close()
    assert code_of(there)["sha256"]
    assert code_of(there) == code_of(here)
    assert files_handed_over("walking:Walker", there, options) == files_handed_over("walking:Walker", here, options)
    assert content_sha256([there.card.name, there.card.settings]) == content_sha256(["walker", here.card.settings])
    assert there.card.runs_on["device"] == "abacus"
    assert there.card.runs_on["host"]
