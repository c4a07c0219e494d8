"""What a process that works for another has to do so that it never outlives it."""

import json
import os
import signal
import sys
import threading
from collections.abc import Sequence
from multiprocessing import parent_process

_END_WITH_PARENT = (
    "import ctypes, os, signal, sys; "
    "ctypes.CDLL(None).prctl(1, signal.SIGKILL); "  # PR_SET_PDEATHSIG; it stays over exec
    "os.getppid() == int(sys.argv[1]) and os.execv(sys.argv[2], sys.argv[2:])"
)


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


def command_that_ends_with_parent(command: Sequence[str]) -> list[str]:
    """Return a command that runs another program, which the kernel ends with the thread that started it.

    However this process ends, SIGKILL included, the program is not left behind. A short Python asks for that and then
    becomes the program; asking between fork and exec would run Python in a process of which only one thread survived.
    Linux only.

    Args:
        command: the program's path and its arguments.
    """
    return [sys.executable, "-I", "-S", "-c", _END_WITH_PARENT, str(os.getpid()), *command]


def python_like_this(module: str, *arguments: str) -> list[str]:
    """Return a command that runs a module of ours as a program, with this interpreter and its module path.

    The program ends with the thread that starts it (`command_that_ends_with_parent`).

    Args:
        module: dotted name; its `main` is called with the arguments.
        arguments: handed to it as text.
    """
    path = json.dumps(sys.path)
    program = (
        "import sys, json, importlib; sys.path[:] = json.loads(sys.argv[1]); "
        "importlib.import_module(sys.argv[2]).main(*sys.argv[3:])"
    )
    return command_that_ends_with_parent([sys.executable, "-c", program, path, module, *arguments])
