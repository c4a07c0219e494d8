"""The server file works in an environment with any major version of websockets from 11 on."""

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.models.remote.environments import WEBSOCKETS_MAJORS, NotOfferedError, environment
from tests.models.remote.servers import PATIENCE_S, look, stub_server
from vsnbench.errors import ModelError, ModelLostError
from vsnbench.models.remote.isolation import IsolatedPolicy, Isolation
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import SPARE_CONNECTIONS

SPINNER = """
class Model:
    card = {"name": "spinner", "sensors": ["rgb"], "runs_on": {}}

    def __init__(self):
        import websockets
        self.card["runs_on"]["websockets"] = websockets.__version__

    def reset(self, goal, seed):
        self.turns = 0

    def act(self, observation):
        self.turns += 1
        return "STOP" if self.turns > 2 else "TURN_LEFT"
"""
Environments = Callable[[int], Path]


@pytest.fixture(scope="session")
def environments(tmp_path_factory: pytest.TempPathFactory) -> Environments:
    made: dict[int, Path] = {}

    def get(major: int) -> Path:
        if major not in made:
            try:
                made[major] = environment(major, tmp_path_factory.mktemp(f"websockets-{major}"))
            except NotOfferedError as error:  # the package index is out of reach, or no longer has this version
                pytest.skip(f"websockets {major}: {error}")
        return made[major]

    return get


@pytest.fixture
def model_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "spinning.py").write_text(SPINNER)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("major", WEBSOCKETS_MAJORS)
def test_a_model_in_another_environment_answers(major: int, environments: Environments, model_directory: Path) -> None:
    policy = IsolatedPolicy("spinning:Model", {}, Isolation(environments(major)))
    try:
        assert policy.card.runs_on["websockets"].split(".")[0] == str(major)
        policy.reset("chair", 1)
        assert [policy.act(look()).action.value for _ in range(3)] == ["TURN_LEFT", "TURN_LEFT", "STOP"]
    finally:
        policy.close()


@pytest.mark.parametrize("major", [WEBSOCKETS_MAJORS[0], WEBSOCKETS_MAJORS[-1]])
def test_the_command_runs_a_model_in_another_environment(
    major: int, environments: Environments, model_directory: Path
) -> None:
    command = [sys.executable, "-m", "vsnbench.cli.main", "run", "--model", "spinning:Model", "--goal", "chair"]
    command += ["--isolate", str(environments(major)), "--starts", "1", "--results", "results", "--json"]
    source = Path(__file__).resolve().parents[3]
    done = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": str(source)}, capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["done"], summary["left"], summary["void_episodes"]) == (1, 0, 0)


@pytest.mark.parametrize("major", [WEBSOCKETS_MAJORS[0], WEBSOCKETS_MAJORS[-1]])
def test_clients_that_say_nothing_take_a_bounded_number_of_threads(
    major: int, environments: Environments, tmp_path: Path
) -> None:
    with stub_server(SPINNER, tmp_path, python=environments(major)) as (url, process), ExitStack() as kept_open:
        threads = Path(f"/proc/{process.pid}/task")
        before = len(list(threads.iterdir()))
        address = ("127.0.0.1", int(url.rpartition(":")[2]))
        clients = [kept_open.enter_context(socket.create_connection(address, PATIENCE_S)) for _ in range(150)]
        give_up = time.monotonic() + PATIENCE_S
        while sum(map(closed_by_server, clients)) < len(clients) - SPARE_CONNECTIONS - 1:
            assert time.monotonic() < give_up, "the server has too many connections"
            time.sleep(0.02)
        while len(list(threads.iterdir())) - before > 2 * (
            SPARE_CONNECTIONS + 1
        ):  # those of closed connections end soon
            assert time.monotonic() < give_up, "the server has too many threads"
            time.sleep(0.02)
        kept_open.close()
        policy = connected(url)
        policy.reset("chair", 1)
        assert policy.act(look()).action.value == "TURN_LEFT"
        policy.close()
    assert "Traceback" not in (tmp_path / "server.log").read_text()


def connected(url: str) -> RemotePolicy:
    """Connect once the server has noticed that its other clients left."""
    give_up = time.monotonic() + PATIENCE_S
    while True:
        try:
            return RemotePolicy(url)
        except ModelLostError:
            assert time.monotonic() < give_up
            time.sleep(0.02)


def closed_by_server(client: socket.socket) -> bool:
    client.setblocking(False)
    try:
        return client.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


def test_a_failing_transport_is_blamed_on_the_models_own_process(model_directory: Path) -> None:
    broken = """
import websockets.sync.server

def fail(*arguments):
    raise RuntimeError("no handshake today")

websockets.sync.server.ServerConnection.handshake = fail
"""
    (model_directory / "spinning.py").write_text(broken + SPINNER)
    with pytest.raises(ModelError) as refused:
        IsolatedPolicy("spinning:Model", {}, Isolation(Path(sys.executable)))
    assert "spinning:Model" in refused.value.statement
    assert "separate process" in refused.value.statement
    assert f"{sys.executable} -m pip install" in refused.value.advice


@pytest.mark.parametrize("package", ["numpy", "msgpack", "websockets"])
def test_a_missing_package_is_named_with_its_installation(package: str, model_directory: Path) -> None:
    bare = model_directory / "bare"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", bare], check=True, timeout=PATIENCE_S)
    for other in {"numpy", "msgpack", "websockets"} - {package}:
        for packages in bare.glob("lib/python*/site-packages"):
            (packages / f"{other}.py").write_text("")
    with pytest.raises(ModelError, match=f"No module named '{package}") as refused:
        IsolatedPolicy("spinning:Model", {}, Isolation(bare / "bin" / "python"))
    assert f"{bare}/bin/python -m pip install" in refused.value.advice
