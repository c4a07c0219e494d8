"""A Ray cluster: its address, wrong addresses, and a campaign on two workers with a token."""

import os
import re
import secrets
import shutil
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from tests.processes import has_ended, wait_until
from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.models.contract import ModelCard
from vsnbench.runner.executors import ray_connection, ray_pool
from vsnbench.runner.executors.ray_connection import ClusterAddress
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import load_site

pytest.importorskip("ray", reason="needs the extra [ray]")


def test_an_address_is_host_and_port() -> None:
    assert ClusterAddress.parse("ray://head:10001") == ClusterAddress("head", 10001)
    assert str(ClusterAddress.parse("ray://head")) == "ray://head:10001"
    assert str(ClusterAddress.parse("ray://[::1]:7")) == "ray://[::1]:7"


@pytest.mark.parametrize(
    "text", ["head:10001", "http://head:1", "ray://", "ray://head:seven", "ray://head:99999", "ray://me@head:1", "auto"]
)
def test_an_invalid_address_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"^--workers .*[;:] give it as ray://host:port"):
        ClusterAddress.parse(text)


def free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize(
    ("model", "device", "gpus", "runs_on"),
    [
        ("pirlnav", None, 0.0, "cpu"),
        ("pirlnav", "auto", 0.25, "cuda"),
        ("pirlnav", "cuda", 1.0, "cuda"),
        ("oracle", None, 1.0, None),
    ],
)
def test_a_worker_uses_the_device_that_it_holds(
    model: str, device: str | None, gpus: float, runs_on: str | None
) -> None:
    options = {} if device is None else {"device": device}
    plan = ray_pool.with_worker_device(
        TrialSetupSpec(load_site("apartment"), model, ("chair",), model_options=options), gpus
    )
    assert plan.model_options.get("device") == runs_on


def test_all_workers_use_the_runtime_that_the_first_one_chose() -> None:
    card = ModelCard("pirlnav", runs_on={"device": "cuda", "runtime": "torch", "threads": 1})
    plan = TrialSetupSpec(load_site("apartment"), "pirlnav", ("chair",), model_options={"weights": "embedded"})
    assert plan.for_elsewhere(card).model_options == {"weights": "embedded", "device": "cuda", "runtime": "torch"}
    theirs = ModelCard("oracle", runs_on={"device": "an H100"})
    assert replace(plan, model="oracle").for_elsewhere(theirs).model_options == {"weights": "embedded"}


@pytest.mark.parametrize(
    ("device", "gpus", "said"), [("cuda", 0.0, "gpus_per_worker in section"), ("cpu", 0.5, "gpus_per_worker = 0.5")]
)
def test_a_device_that_no_worker_holds_is_refused(device: str, gpus: float, said: str) -> None:
    plan = TrialSetupSpec(load_site("apartment"), "pirlnav", ("chair",), model_options={"device": device})
    with pytest.raises(UsageError, match=said):
        ray_pool.with_worker_device(plan, gpus)


def test_a_refused_connection_is_reported_at_once() -> None:
    with pytest.raises(VsnbenchError, match=r"--workers ray://127\.0\.0\.1:\d+: cannot connect \(Connection refused\)"):
        ray_connection.connect(ClusterAddress("127.0.0.1", free_port()))


def test_a_silent_server_is_abandoned_at_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_connection, "ANSWER_TIMEOUT_S", 0.5)
    with closing(socket.socket()) as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        with pytest.raises(VsnbenchError, match="gave no answer of a Ray client server"):
            ray_connection.connect(ClusterAddress("127.0.0.1", mute.getsockname()[1]))


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (ConnectionError("ray client connection timeout"), r"ray client connection timeout; see docs/scale.md"),
        (
            RuntimeError(
                "Version mismatch: The cluster was started with: Ray: 2.48.0 Python: 3.11.7 This process has 2.60"
            ),
            r"another version .* has 2\.60; install the cluster's here: .*pip install 'ray\[client\]==2\.48\.0'",
        ),
        (
            ConnectionError(
                "Initialization failure: Traceback: RuntimeError: Starting Ray client server failed. See x"
            ),
            r"could not start a client server in time; try again",
        ),
        (ValueError("what\nelse"), r"ray://head:10001: what else; see docs/scale\.md"),
    ],
)
def test_every_connection_error_is_one_line(raised: Exception, said: str) -> None:
    refusal = str(ray_connection.refusal(ClusterAddress("head", 10001), raised))
    assert re.search(said, refusal), refusal
    assert "\n" not in refusal


def ray(*words: str, environment: dict[str, str]) -> None:
    command = [sys.executable, "-m", "ray.scripts.scripts", *words]
    subprocess.run(command, env=environment, check=True, capture_output=True, timeout=120)


@pytest.fixture(scope="module")
def head(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, dict[str, str]]]:
    """A local cluster of two cores with a token: its address, and the environment with the token."""
    directory = tmp_path_factory.mktemp("r", numbered=True)
    short = Path(f"/tmp/ray-{os.getpid()}")  # the path of a socket is limited to 107 characters
    port, client_port = free_port(), free_port()
    environment = os.environ | {
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN": secrets.token_hex(16),
        "RAY_USAGE_STATS_ENABLED": "0",
        "GRPC_ENABLE_FORK_SUPPORT": "0",  # see docs/scale.md: the head forks its client servers
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]),
        "HOME": str(directory),
    }
    words = ["--head", f"--port={port}", f"--ray-client-server-port={client_port}", "--include-dashboard=false"]
    sizes = ["--num-cpus=2", "--object-store-memory=200000000", "--min-worker-port=0", "--max-worker-port=0"]
    try:
        ray("start", *words, *sizes, f"--temp-dir={short}", environment=environment)
        yield f"ray://{_host_of(client_port)}:{client_port}", environment
    finally:
        # `ray stop` would stop all clusters of this user.
        ours = [one for one in psutil.process_iter() if _knows(one, environment["RAY_AUTH_TOKEN"])]
        for process in ours:
            process.kill()
        wait_until(lambda: all(map(has_ended, ours)), "the cluster's processes end")
        shutil.rmtree(short, ignore_errors=True)


def _host_of(port: int) -> str:
    """Return the address of the client server once it listens; Ray may not use loopback."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if host := _listener(port):
            return host
        time.sleep(0.1)
    raise AssertionError(f"no server listens on {port}")


def _listener(port: int) -> str:
    for connection in psutil.net_connections("tcp"):
        if connection.status == psutil.CONN_LISTEN and connection.laddr and connection.laddr.port == port:
            return (
                str(connection.laddr.ip)
                .removeprefix("::ffff:")
                .replace("::", "127.0.0.1")
                .replace("0.0.0.0", "127.0.0.1")
            )
    return ""


def _knows(process: psutil.Process, token: str) -> bool:
    """Return whether a process belongs to the cluster: all of its processes have the token."""
    try:
        return process.environ().get("RAY_AUTH_TOKEN") == token
    except psutil.Error:
        return False


def run_on(
    address: str, environment: dict[str, str], directory: Path, config: str = ""
) -> "subprocess.CompletedProcess[str]":
    words = ["run", "--model", "random", "--goal", "chair", "--starts", "1-3", "--max-steps", "3", "--workers", address]
    (directory / "vsnbench.toml").write_text(config)
    command = [sys.executable, "-m", "vsnbench.cli.main", *words, "--results", str(directory)]
    return subprocess.run(command, cwd=directory, env=environment, capture_output=True, text=True, timeout=200)


@pytest.mark.parametrize(
    ("changed", "config", "reported"),
    [
        ({"RAY_AUTH_TOKEN": "f" * 32}, "", "rejects this token (RAY_AUTH_TOKEN)"),
        ({"RAY_AUTH_MODE": ""}, "", "RAY_AUTH_MODE is not set"),
        ({"RAY_AUTH_TOKEN": "", "RAY_AUTH_TOKEN_PATH": "/nowhere"}, "", "none is set here"),
        ({}, "[cluster]\ngpus_per_worker = 1", "has 2 cores and 0 GPUs, and each worker needs a core and 1 GPU"),
    ],
)
def test_each_connection_problem_has_its_own_line(
    head: tuple[str, dict[str, str]], tmp_path: Path, changed: dict[str, str], config: str, reported: str
) -> None:
    address, environment = head
    done = run_on(address, environment | changed, tmp_path, config)
    assert done.returncode in (1, 2)
    assert reported in done.stderr
    assert done.stderr.strip().count("\n") == 0


def test_a_campaign_on_a_cluster_that_requires_a_token(head: tuple[str, dict[str, str]], tmp_path: Path) -> None:
    address, environment = head
    done = run_on(address, environment, tmp_path, "[cluster]\nworkers = 50")
    assert done.returncode == 0, done.stderr
    assert f"2 workers on {address}" in done.stderr
    assert "50 requested" in done.stderr
    with closing(sqlite3.connect(tmp_path / "vsnbench.db")) as connection:
        counted = "SELECT COUNT(*), COUNT(DISTINCT trial_id), SUM(state = 'judged') FROM episode"
        assert connection.execute(counted).fetchall() == [(3, 3, 3)]
        directories = [row[0] for row in connection.execute("SELECT images_directory FROM episode")]
    assert all(list((tmp_path / directory / "rgb").iterdir()) for directory in directories)
