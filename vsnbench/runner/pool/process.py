"""A worker's process, seen from the driver before either knows what is to be run.

A process needs a second of imports before it can make a bench, and the driver one before it can say which: where
workers will plainly be wanted they are started first, and both happen side by side. Whoever imports this loads little.
"""

import math
import os
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vsnbench.compute_threads import one_thread_environment
from vsnbench.workers import python_like_this

PROGRAM = "vsnbench.runner.pool.worker"
MOST_RECRUITS = 4
"""Of more the first seconds would gain nothing, and memory has not been counted yet."""

_recruits: "list[WorkerProcess]" = []


class WorkerProcess:
    """A process that gets ready to take orders over a socket; it ends with this one."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                python_like_this(PROGRAM, str(theirs.fileno())),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env={**os.environ, **one_thread_environment()},
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # Ctrl-C is for the driver, which has the episodes ended
            )
        self.socket = ours
        """To be closed by whoever takes it."""

    @property
    def pid(self) -> int:
        """The process's number."""
        return self._process.pid

    def kill(self) -> None:
        """End it, at once."""
        self._process.kill()

    def bury(self) -> int:
        """End it where it has not ended yet, and return how it ended: an exit code, or a signal's number below 0."""
        self._process.kill()
        return self._process.wait()


def new_worker() -> WorkerProcess:
    """Return a process that is nobody's yet: a recruit, or one that starts now."""
    return _recruits.pop() if _recruits else WorkerProcess()


@contextmanager
def recruits(count: int) -> Iterator[None]:
    """Start processes for whoever asks for workers meanwhile; those that nobody took are ended with the block."""
    _recruits.extend(WorkerProcess() for _ in range(count))
    try:
        yield
    finally:
        dismiss_recruits()


def dismiss_recruits() -> None:
    """End those that nobody has taken: there are as many workers as are wanted."""
    for recruit in _recruits:
        recruit.kill()
    while _recruits:
        recruit = _recruits.pop()
        recruit.bury()
        recruit.socket.close()


def likely_workers(asked: str, *, all_starts: bool) -> int:
    """Return how many processes are worth starting before anything is known of a simulated campaign but its options.

    Args:
        asked: as for `--workers`; what is no number is refused later, by others.
        all_starts: it is about every starting position, so that there are enough trials for several workers.
    """
    cores = granted_cores()
    wanted = int(asked) if asked.isdecimal() else cores if asked == "auto" and all_starts else 1
    return min(wanted, cores, MOST_RECRUITS) if wanted > 1 else 0


def granted_cores() -> int:
    """Return how many cores this process may use, by its affinity and by what a container is granted."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, _, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").partition(" ")
    except OSError:
        return cores
    return min(cores, max(1, math.ceil(float(quota) / float(period)))) if quota.isdecimal() else cores
