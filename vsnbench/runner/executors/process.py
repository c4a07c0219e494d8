"""Worker processes seen from the driver: a fork server and the workers that it forks.

The fork server needs a second of imports before it can fork. Where workers will certainly be needed, it starts first
and imports while the driver prepares the campaign, so this module imports little.
"""

import contextlib
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager

from vsnbench.runner.executors.fork_server import END, FORK
from vsnbench.runtime.child_process import python_like_this
from vsnbench.runtime.resources import granted_cores
from vsnbench.runtime.threads import one_thread_environment

PROGRAM = "vsnbench.runner.executors.fork_server"
END_TIMEOUT_S = 10.0
"""Time for a fork server to end its workers; afterwards the kernel ends them with it."""
REAP_TIMEOUT_S = 2.0
"""Time for the kernel to end the workers of a lost fork server."""


class ForkServer:
    """A process that forks workers. It and its workers end with this process."""

    def __init__(self) -> None:
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._has_forked = False
        with theirs:
            self._process = subprocess.Popen(
                python_like_this(PROGRAM, str(theirs.fileno())),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env={**os.environ, **one_thread_environment()},
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # Ctrl-C is for the driver, which ends the episodes
            )

    @property
    def pid(self) -> int:
        """Process ID of the server."""
        return self._process.pid

    def fork(self) -> "WorkerProcess":
        """Return a new worker; waits for the server's imports.

        Raises:
            ConnectionError: the server has ended, and its workers with it.
        """
        ours, theirs = socket.socketpair()
        try:
            with theirs:
                socket.send_fds(self._control, [FORK], [theirs.fileno()])
            pid = self._answer()
            self._has_forked = True
            return WorkerProcess(self, pid, ours)
        except BaseException:
            ours.close()
            raise

    def end_worker(self, pid: int) -> int:
        """End a worker if it runs. Returns its exit code, or the negative number of the signal that ended it."""
        try:
            self._control.send(b"%s %d" % (END, pid))
            return self._answer()
        except OSError:  # the server has ended, or the socket is closed: the kernel has ended its workers
            # A killed process closes its sockets before its children get another parent: wait for its end first.
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(REAP_TIMEOUT_S)
            _reap(pid)
            return -signal.SIGKILL

    def end(self) -> None:
        """End the server and all its workers; a server that is still importing is killed."""
        self._control.close()  # the server takes this for the end of the driver
        if self._has_forked:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(END_TIMEOUT_S)
        self._process.kill()
        self._process.wait()

    def _answer(self) -> int:
        if not (answer := self._control.recv(64)):
            raise ConnectionError(f"the fork server {self.pid} has ended")
        return int(answer)


def _reap(pid: int) -> None:
    """Wait for a worker of a lost fork server if this process has adopted it; otherwise it remains as a zombie."""
    give_up_s = time.monotonic() + REAP_TIMEOUT_S
    with contextlib.suppress(ChildProcessError):  # another process has adopted it
        while os.waitpid(pid, os.WNOHANG)[0] == 0 and time.monotonic() < give_up_s:
            time.sleep(0.01)


class WorkerProcess:
    """A process that takes orders over a socket."""

    def __init__(self, server: ForkServer, pid: int, ours: socket.socket) -> None:
        self._server = server
        self.pid = pid
        self.socket = ours
        """The caller closes it."""

    def end(self) -> int:
        """End the process if it runs. Returns its exit code, or the negative number of the signal that ended it."""
        return self._server.end_worker(self.pid)


_early: list[ForkServer] = []


def fork_server() -> ForkServer:
    """Return the fork server that was started early, or a new one."""
    return _early.pop() if _early else ForkServer()


@contextmanager
def early_fork_server(*, wanted: bool) -> Iterator[None]:
    """Start a fork server for a later call of `fork_server`; the block's end stops one that was not used."""
    if wanted:
        _early.append(ForkServer())
    try:
        yield
    finally:
        dismiss_fork_server()


def dismiss_fork_server() -> None:
    """End a fork server that was started early and is not used."""
    while _early:
        _early.pop().end()


def wants_workers(requested: str, *, all_starts: bool) -> bool:
    """Return whether a simulated campaign will certainly need workers, judged by its options alone.

    Args:
        requested: value of `--workers`; a later check refuses what is not a number.
        all_starts: the campaign includes every starting position, enough trials for several workers.
    """
    if requested.isdecimal():
        return int(requested) > 1
    return requested == "auto" and all_starts and granted_cores() > 1
