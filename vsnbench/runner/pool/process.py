"""The processes of a pool, seen from the driver: a fork server, and the workers that it forks.

The server needs a second of imports before it can fork, and the driver one before it can say what is to be run: where
workers will plainly be wanted the server is started first, and both happen side by side. Whoever imports this loads
little.
"""

import contextlib
import math
import os
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vsnbench.compute_threads import one_thread_environment
from vsnbench.runner.pool.fork_server import BURY, FORK
from vsnbench.workers import python_like_this

PROGRAM = "vsnbench.runner.pool.fork_server"
END_TIMEOUT_S = 10.0
"""How long a fork server may take to bury its workers; then the kernel ends them with it."""


class ForkServer:
    """A process that forks workers; it and they end with this process."""

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
                start_new_session=True,  # Ctrl-C is for the driver, which has the episodes ended
            )

    @property
    def pid(self) -> int:
        """The server's own number."""
        return self._process.pid

    def fork(self) -> "WorkerProcess":
        """Return a new worker, as soon as the server can make one.

        Raises:
            ConnectionError: the server is gone, and its workers are too.
        """
        ours, theirs = socket.socketpair()
        try:
            with theirs:
                socket.send_fds(self._control, [FORK], [theirs.fileno()])
            number = self._answer()
            self._has_forked = True
            return WorkerProcess(self, number, ours)
        except BaseException:
            ours.close()
            raise

    def bury(self, number: int) -> int:
        """End a worker where it has not ended yet, and return how it ended: an exit code, or a signal's number below 0.

        Args:
            number: the process's.
        """
        try:
            self._control.send(b"%s %d" % (BURY, number))
            return self._answer()
        except OSError:  # nobody is there any more, or the socket is closed
            return -signal.SIGKILL  # by the kernel, when its server went

    def end(self) -> None:
        """End it and all its workers; one that is still importing hears nothing, and is ended at once."""
        self._control.close()  # that the driver is gone is what it takes this for
        if self._has_forked:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(END_TIMEOUT_S)
        self._process.kill()
        self._process.wait()

    def _answer(self) -> int:
        if not (answer := self._control.recv(64)):
            raise ConnectionError(f"the fork server {self.pid} is gone")
        return int(answer)


class WorkerProcess:
    """A process that takes orders over a socket."""

    def __init__(self, server: ForkServer, pid: int, ours: socket.socket) -> None:
        self._server = server
        self.pid = pid
        """The process's number."""
        self.socket = ours
        """To be closed by whoever takes it."""

    def bury(self) -> int:
        """End it where it has not ended yet, and return how it ended: an exit code, or a signal's number below 0."""
        return self._server.bury(self.pid)


_early: list[ForkServer] = []


def fork_server() -> ForkServer:
    """Return one that is nobody's yet: started early, or now."""
    return _early.pop() if _early else ForkServer()


@contextmanager
def early_fork_server(*, wanted: bool) -> Iterator[None]:
    """Start a fork server for whoever asks for one meanwhile; one that nobody took is ended with the block."""
    if wanted:
        _early.append(ForkServer())
    try:
        yield
    finally:
        dismiss_fork_server()


def dismiss_fork_server() -> None:
    """End the one that was started early and that nobody has taken: there will be no workers."""
    while _early:
        _early.pop().end()


def wants_workers(asked: str, *, all_starts: bool) -> bool:
    """Return whether a simulated campaign of which nothing is known but its options will plainly want workers.

    Args:
        asked: as for `--workers`; what is no number is refused later, by others.
        all_starts: it is about every starting position, so that there are enough trials for several workers.
    """
    wanted = int(asked) if asked.isdecimal() else granted_cores() if asked == "auto" and all_starts else 1
    return wanted > 1


def granted_cores() -> int:
    """Return how many cores this process may use, by its affinity and by what a container is granted."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, _, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").partition(" ")
    except OSError:
        return cores
    return min(cores, max(1, math.ceil(float(quota) / float(period)))) if quota.isdecimal() else cores
