"""What a process that works for another has to do so that it never outlives it."""

import os
import signal
import threading
from multiprocessing import parent_process


def end_with_parent() -> None:
    """Let this worker end at once with Ctrl-C, and when its parent is gone, in place of waiting for work for ever.

    For the `initializer` of a `ProcessPoolExecutor`. Python's own handler of Ctrl-C would wait for the C code that is
    running, such as a database that counts; a parent that is killed cannot tell its workers.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
