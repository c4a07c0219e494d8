"""A process that imports once what every local worker needs, and forks workers on request.

A new Python process would import for a second before it could make a trial setup, and the first compiled loop takes
another third of a second to load. A forked worker starts within milliseconds and shares the memory. Only a process
with a single thread may be forked, so this one does nothing else. Linux only, as `vsnbench.runtime.child_process`.
"""

import ctypes
import gc
import os
import signal
import socket

from vsnbench.runtime.child_process import adopt_orphans, end_descendants

FORK, END = b"fork", b"end"
"""Fork a worker for the attached socket and answer its process ID; end a worker and answer how it ended."""
_SET_END_WITH_PARENT = 1
"""PR_SET_PDEATHSIG: the kernel ends a worker when this process ends in any way."""


def main(descriptor: str) -> None:
    """Serve the driver at the socket with this file descriptor until it ends; in a forked worker, run the worker."""
    adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends the process without a traceback
    gc.disable()  # imported modules stay
    _load()
    gc.freeze()
    gc.enable()
    own = _serve(socket.socket(fileno=int(descriptor)))
    if own is not None:
        import numpy as np

        from vsnbench.runner.executors import worker

        np.random.seed()  # noqa: NPY002 - a model that draws without a seed must differ between workers
        worker.main(own)


def _load() -> None:
    """Import what a worker needs, and load the first compiled loop: most of the compiler comes with it."""
    import cv2  # noqa: F401
    import mujoco  # noqa: F401
    import numpy as np

    import vsnbench.robots.simulated
    import vsnbench.runner.executors.worker  # noqa: F401
    from vsnbench.values.encoding.depth_kernels import to_millimetres

    to_millimetres(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.uint16))


def _serve(control: socket.socket) -> str | None:
    """Carry out orders until the driver ends. In a worker, returns the descriptor of its socket to the driver."""
    server, prctl = os.getpid(), ctypes.CDLL(None).prctl
    workers: set[int] = set()
    while True:
        message, descriptors, _, _ = socket.recv_fds(control, 64, 1)
        order, _, argument = message.partition(b" ")
        if order == FORK:
            pid = os.fork()
            if pid == 0:
                prctl(_SET_END_WITH_PARENT, signal.SIGKILL)
                if os.getppid() != server:
                    os._exit(1)
                control.close()
                return str(descriptors[0])
            workers.add(pid)
            os.close(descriptors[0])
            answer = pid
        elif order == END:
            answer = _end(int(argument))
            workers.discard(int(argument))
        else:
            for pid in workers:
                os.kill(pid, signal.SIGKILL)
            for pid in workers:
                _end(pid)
            end_descendants()  # processes that the models of the workers started
            os._exit(0)
        try:
            control.send(str(answer).encode())
        except OSError:  # the driver has ended: the next receive returns nothing
            continue


def _end(pid: int) -> int:
    """End a worker if it runs. Returns its exit code, or the negative number of the signal that ended it."""
    os.kill(pid, signal.SIGKILL)  # the process ID is not reused before waitpid
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
