"""A fork server and its workers: what is forked is a worker like any other, and nothing of them is left."""

import os
import signal
from multiprocessing.connection import Connection

import psutil
import pytest

from tests.processes import has_ended, wait_until
from vsnbench.runner.pool import process
from vsnbench.runner.pool.messages import Stop
from vsnbench.runner.pool.process import (
    ForkServer,
    early_fork_server,
    fork_server,
    granted_cores,
    wants_workers,
)
from vsnbench.runner.stopping import StopAuthor, StopRequest

BEFORE = {child.pid for child in psutil.Process().children()}
STOP = Stop(StopRequest(StopAuthor.SYSTEM, "a test"))


@pytest.mark.slow
def test_workers_are_forked_by_a_process_of_one_thread_and_end_with_it() -> None:
    server = ForkServer()
    try:
        left, right, third = (server.fork() for _ in range(3))
        seen = psutil.Process(server.pid)
        forked = {child.pid: child for child in seen.children()}
        assert set(forked) == {left.pid, right.pid, third.pid}
        assert seen.num_threads() == 1, "a lock that another thread held would be held for ever in a worker"
        connection = Connection(left.socket.detach())
        connection.send(STOP)
        wait_until(lambda: has_ended(forked[left.pid]), "a worker ends when it is told to")
        assert left.bury() == 0
        right.socket.close()
        wait_until(lambda: has_ended(forked[right.pid]), "nobody that was forked later holds its socket open")
        assert right.bury() == 1
        assert not has_ended(forked[third.pid])
    finally:
        server.end()
    assert not psutil.pid_exists(server.pid)
    assert not psutil.pid_exists(third.pid)


@pytest.mark.slow
def test_what_an_ended_fork_server_has_forked_ends_with_it_and_is_known_to_have_been_killed(
    capfd: pytest.CaptureFixture[str],
) -> None:
    server = ForkServer()
    try:
        worker = server.fork()
        forked = psutil.Process(worker.pid)
        os.kill(server.pid, signal.SIGINT)
        wait_until(lambda: has_ended(forked), "the kernel ends it")
        assert worker.bury() == -signal.SIGKILL
        with pytest.raises(ConnectionError):
            server.fork()
        assert capfd.readouterr().err == ""
    finally:
        server.end()
    assert worker.bury() == -signal.SIGKILL, "who is lost with another is buried when the server has been"


def test_a_fork_server_that_does_not_answer_yet_is_ended_without_waiting_for_it(
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


def test_a_fork_server_that_was_started_early_is_taken_by_whoever_asks_or_ended_with_the_block() -> None:
    with early_fork_server(wanted=True):
        (nobodys,) = _servers()
    assert not psutil.pid_exists(nobodys)
    with early_fork_server(wanted=True):
        taken = fork_server()
        assert _servers() == {taken.pid}
    try:
        assert _servers() == {taken.pid}, "it is somebody's"
    finally:
        taken.end()
    assert _servers() == set()


def _forked_within(seconds: float, server: ForkServer) -> None:
    signal.setitimer(signal.ITIMER_REAL, seconds)
    server.fork()


def _servers() -> set[int]:
    return {child.pid for child in psutil.Process().children()} - BEFORE


@pytest.mark.parametrize(
    ("asked", "all_starts", "wanted"),
    [("auto", True, granted_cores() > 1), ("auto", False, False), ("1", True, False), ("4000", False, True)],
)
def test_only_a_run_that_will_plainly_want_workers_starts_a_fork_server(
    asked: str, all_starts: bool, wanted: bool
) -> None:
    assert wants_workers(asked, all_starts=all_starts) == wanted
    assert not wants_workers("many", all_starts=True)
