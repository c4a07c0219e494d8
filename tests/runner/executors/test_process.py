"""The fork server and its workers."""

import contextlib
import os
import signal
from multiprocessing.connection import Connection

import psutil
import pytest

from tests.processes import has_ended, wait_until
from vsnbench.runner.executors import process
from vsnbench.runner.executors.process import (
    ForkServer,
    early_fork_server,
    fork_server,
    wants_workers,
)
from vsnbench.runner.stopping.requests import StopAuthor, StopRequest
from vsnbench.runtime.child_process import adopt_orphans
from vsnbench.runtime.resources import granted_cores

STOP = StopRequest(StopAuthor.SYSTEM, "a test")


def test_a_single_threaded_server_forks_workers_and_ends_them() -> None:
    server = ForkServer()
    try:
        left, right, third = (server.fork() for _ in range(3))
        seen = psutil.Process(server.pid)
        forked = {child.pid: child for child in seen.children()}
        assert set(forked) == {left.pid, right.pid, third.pid}
        assert seen.num_threads() == 1, "a lock held by another thread would stay held in a worker"
        connection = Connection(left.socket.detach())
        connection.send(STOP)
        wait_until(lambda: has_ended(forked[left.pid]), "a worker ends when it is told to")
        assert left.end() == 0
        right.socket.close()
        wait_until(lambda: has_ended(forked[right.pid]), "no later worker holds its socket open")
        assert right.end() == 1
        assert not has_ended(forked[third.pid])
    finally:
        server.end()
    assert not psutil.pid_exists(server.pid)
    assert not psutil.pid_exists(third.pid)


def test_a_killed_fork_server_leaves_no_zombies() -> None:
    adopt_orphans()
    server = ForkServer()
    try:
        worker = server.fork()
        os.kill(server.pid, signal.SIGKILL)
        assert worker.end() == -signal.SIGKILL
        assert not psutil.pid_exists(worker.pid)
    finally:
        server.end()
        adopt_orphans(wanted=False)


def test_workers_of_an_ended_fork_server_are_reported_as_killed(
    capfd: pytest.CaptureFixture[str],
) -> None:
    server = ForkServer()
    try:
        worker = server.fork()
        forked = psutil.Process(worker.pid)
        os.kill(server.pid, signal.SIGINT)
        wait_until(lambda: has_ended(forked), "the kernel ends it")
        assert worker.end() == -signal.SIGKILL
        with pytest.raises(ConnectionError):
            server.fork()
        assert capfd.readouterr().err == ""
    finally:
        server.end()
    assert worker.end() == -signal.SIGKILL, "a worker that is lost with another is reaped after the server"


def test_a_starting_fork_server_is_ended_without_waiting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(process, "END_TIMEOUT_S", 3600.0)
    server = ForkServer()
    try:
        os.kill(server.pid, signal.SIGSTOP)
        before = signal.signal(signal.SIGALRM, interrupt)
        try:
            with pytest.raises(KeyboardInterrupt):
                _forked_within(0.05, server)
        finally:
            signal.signal(signal.SIGALRM, before)
    finally:
        server.end()
    assert not psutil.pid_exists(server.pid)


def test_an_early_fork_server_is_used_or_ended() -> None:
    others = _fork_servers()
    with early_fork_server(wanted=True):
        (unused,) = _fork_servers() - others
    assert not psutil.pid_exists(unused)
    with early_fork_server(wanted=True):
        taken = fork_server()
        assert _fork_servers() - others == {taken.pid}
    try:
        assert _fork_servers() - others == {taken.pid}, "it is in use"
    finally:
        taken.end()
    assert not _fork_servers() - others


def _forked_within(seconds: float, server: ForkServer) -> None:
    signal.setitimer(signal.ITIMER_REAL, seconds)
    server.fork()


def _fork_servers() -> set[int]:
    """Return the fork servers of this process; earlier tests may have left other children."""
    servers = set()
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
            if process.PROGRAM in child.cmdline():
                servers.add(child.pid)
    return servers


@pytest.mark.parametrize(
    ("asked", "all_starts", "wanted"),
    [("auto", True, granted_cores() > 1), ("auto", False, False), ("1", True, False), ("4000", False, True)],
)
def test_only_a_run_that_needs_workers_starts_a_fork_server(asked: str, all_starts: bool, wanted: bool) -> None:
    assert wants_workers(asked, all_starts=all_starts) == wanted
    assert not wants_workers("many", all_starts=True)
