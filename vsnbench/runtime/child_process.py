"""Child processes that always end with their parent."""

import ctypes
import json
import os
import signal
import sys
import threading
from collections.abc import Collection, Sequence
from contextlib import suppress
from multiprocessing import parent_process
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import psutil

_END_WITH_PARENT = (
    "import ctypes, os, signal, sys; "
    "prctl = ctypes.CDLL(None).prctl; "
    "prctl(1, signal.SIGKILL); "  # PR_SET_PDEATHSIG; it is kept across exec
    "os.getppid() == int(sys.argv[1]) and os.execv(sys.argv[2], sys.argv[2:])"
)


_GIVE_UP_CAPABILITIES = (
    # PR_CAPBSET_DROP of all capabilities except CAP_CHOWN to CAP_FSETID, which are about files; then
    # PR_SET_NO_NEW_PRIVS
    "[prctl(24, number, 0, 0, 0) for number in range(5, 64)]; prctl(38, 1, 0, 0, 0); "
)
_SET_DUMPABLE, _SET_CHILD_SUBREAPER = 4, 36
_END_ATTEMPTS = 5
_END_TIMEOUT_S = 2.0


def end_with_parent() -> None:
    """Let this worker end at once on Ctrl-C and when its parent ends, instead of waiting for work.

    Use it as `initializer` of a `ProcessPoolExecutor`. Python's own handler of Ctrl-C would wait for running C code,
    such as a database query; a killed parent cannot notify its workers.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def hide_memory() -> None:
    """Prevent processes of the same user from reading this process's memory through /proc or ptrace; Linux only.

    Root may still read it, unless it has dropped the capability (`command_that_ends_with_parent`).
    """
    ctypes.CDLL(None).prctl(_SET_DUMPABLE, 0, 0, 0, 0)


def adopt_orphans(*, wanted: bool = True) -> None:
    """Become the parent of every orphaned descendant, so that `end_descendants` finds it; Linux only."""
    ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, int(wanted), 0, 0, 0)


def descendants() -> "list[psutil.Process]":
    """Return all running descendants of this process."""
    import psutil

    running = []
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if process.status() != psutil.STATUS_ZOMBIE:
                running.append(process)
    return running


def end_descendants(spared_pids: Collection[int] = ()) -> list[str]:
    """End all descendants of this process; return their names."""
    import psutil

    names: dict[int, str] = {}
    for _ in range(_END_ATTEMPTS):  # orphans of an ended process become children of this process only then
        found = [process for process in descendants() if process.pid not in spared_pids]
        if not found:
            break
        for process in found:
            with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
                names[process.pid] = process.name()
                process.kill()
        psutil.wait_procs(found, _END_TIMEOUT_S)
    return list(names.values())


def command_that_ends_with_parent(command: Sequence[str], *, unprivileged: bool = False) -> list[str]:
    """Return a command that runs a program which the kernel ends together with the thread that started it.

    The program never outlives this process, even after SIGKILL. A short Python program requests this and then executes
    the program; a request between fork and exec would run Python in a process with only one surviving thread. Linux
    only.

    Args:
        command: path and arguments of the program.
        unprivileged: whether to drop root's capabilities except those for files, above all to read the memory of other
            processes; child programs cannot regain them.
    """
    program = _END_WITH_PARENT
    if unprivileged:
        program = program.replace("os.getppid()", f"{_GIVE_UP_CAPABILITIES}os.getppid()")
    return [sys.executable, "-I", "-S", "-c", program, str(os.getpid()), *command]


def python_like_this(module: str, *arguments: str) -> list[str]:
    """Return a command that runs one of our modules with this interpreter and its module path.

    The module's `main` gets the arguments. The program ends with the thread that starts it
    (`command_that_ends_with_parent`).
    """
    path = json.dumps(sys.path)
    program = (
        "import sys, json, importlib; sys.path[:] = json.loads(sys.argv[1]); "
        "importlib.import_module(sys.argv[2]).main(*sys.argv[3:])"
    )
    return command_that_ends_with_parent([sys.executable, "-c", program, path, module, *arguments])
