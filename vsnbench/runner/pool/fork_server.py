"""A process that loads once what every worker of this machine needs, and becomes one whenever it is told to.

A worker that starts anew imports for a second before it can make a bench, and the first loop that was compiled takes
another third of one to load; forked from here it has all of that within milliseconds, and shares the memory. Only a
process with a single thread may be forked: this one imports, and does nothing else. Linux only, as `vsnbench.workers`.
"""

import ctypes
import gc
import os
import signal
import socket

FORK, BURY = b"fork", b"bury"
"""Fork a worker for the socket that comes along, and answer its number; end the one named, and answer how it ended."""
_SET_END_WITH_PARENT = 1
"""PR_SET_PDEATHSIG: the kernel ends a worker when this process is gone, however it ended."""


def main(descriptor: str) -> None:
    """Do as the driver says until it is gone; in a worker, be one.

    Args:
        descriptor: the number of the socket to the driver.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # whoever sends it that wants it gone, without a traceback
    gc.disable()  # what is imported stays
    _load()
    gc.freeze()
    gc.enable()
    own = _serve(socket.socket(fileno=int(descriptor)))
    if own is not None:
        import numpy as np

        from vsnbench.runner.pool import worker

        np.random.seed()  # noqa: NPY002 - a model that draws without a seed draws something else in every worker
        worker.main(own)


def _load() -> None:
    """Import what a worker needs, and have the first compiled loop loaded: with it comes most of the compiler."""
    import cv2  # noqa: F401
    import mujoco  # noqa: F401
    import numpy as np

    import vsnbench.robots.simulated
    import vsnbench.runner.pool.worker  # noqa: F401
    from vsnbench.protocol.depth_rows import to_millimetres

    to_millimetres(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.uint16))


def _serve(control: socket.socket) -> str | None:
    """Carry out orders until the driver is gone; in a worker, return the number of its own socket to the driver."""
    server, prctl = os.getpid(), ctypes.CDLL(None).prctl
    workers: set[int] = set()
    while True:
        message, descriptors, _, _ = socket.recv_fds(control, 64, 1)
        order, _, named = message.partition(b" ")
        if order == FORK:
            number = os.fork()
            if number == 0:
                prctl(_SET_END_WITH_PARENT, signal.SIGKILL)
                if os.getppid() != server:
                    os._exit(1)
                control.close()
                return str(descriptors[0])
            workers.add(number)
            os.close(descriptors[0])
            answer = number
        elif order == BURY:
            answer = _bury(int(named))
            workers.discard(int(named))
        else:
            for number in workers:
                os.kill(number, signal.SIGKILL)
            for number in workers:
                _bury(number)
            os._exit(0)
        try:
            control.send(str(answer).encode())
        except OSError:  # the driver is gone: nothing is heard from it any more
            continue


def _bury(number: int) -> int:
    """End a worker where it has not ended yet, and return how it ended: an exit code, or a signal's number below 0."""
    os.kill(number, signal.SIGKILL)  # nobody else has its number before it is buried
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
