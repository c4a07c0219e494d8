"""`vsnbench` without its seconds of imports: a process that has made them forks for every command that is typed.

`python warm.py NAME` serves; `vsnbench`, as `warm_vsnbench` puts it on a path, hands its words, directory, environment
and streams over, passes signals on, and ends with the command's own exit code.
"""

import array
import atexit
import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.processes import PATIENCE_S, wait_until

_HEAVY = (
    "vsnbench.cli.main",
    *("vsnbench.cli.run", "vsnbench.cli.report", "vsnbench.cli.sites", "vsnbench.cli.study_running"),
    *("vsnbench.runner.launch", "vsnbench.runner.study_session", "vsnbench.robots.simulated", "vsnbench.report.build"),
    *("vsnbench.models.pirlnav.policy", "vsnbench.models.vlv.policy", "vsnbench.console.operator_page"),
    *("torch", "numba", "onnx", "alembic", "matplotlib.pyplot", "scipy.stats"),
)
_CLIENT = """#!{python} -IS
import array, json, os, signal, socket, sys
if sys.argv[1:] and sys.argv[1].endswith("-completion"):  # asks which shell its parent is
    os.execv({real!r}, [{real!r}, *sys.argv[1:]])
link = socket.socket(socket.AF_UNIX)
link.connect("\\0" + {name!r})
words = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
streams = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [0, 1, 2]))]
link.sendmsg([len(words).to_bytes(4, "big")], streams)
link.sendall(words)
heard = link.makefile()
pid = int(heard.readline())
def pass_on(number, _):
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        pass  # it has just ended
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, pass_on)
sys.exit(int(heard.readline()))
"""


@contextmanager
def warm_vsnbench(directory: Path) -> Iterator[Path]:
    """Serve, and give a directory for `$PATH` in which `vsnbench` is, unless this machine's libraries forbid forks."""
    name = f"vsnbench-{uuid.uuid4()}"
    directory.mkdir()
    client = directory / "vsnbench"
    real = str(Path(sys.executable).parent / "vsnbench")
    client.write_text(_CLIENT.format(python=sys.executable, real=real, name=name))
    client.chmod(0o755)
    root = Path(__file__).resolve().parents[2]
    words = [sys.executable, "-m", "tests.docs.warm", name]
    with subprocess.Popen(words, cwd=root, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL) as server:
        assert server.stdout is not None
        try:
            wait_until(lambda: select.select([server.stdout], [], [], 0)[0], "vsnbench is warm", 4 * PATIENCE_S)
            if server.stdout.readline() != b"warm\n":
                client.unlink()  # the real one comes next on the path
            yield directory
        finally:
            server.kill()


def serve(name: str) -> None:
    """Fork for every command, until killed; returns in the process that is to run one."""
    import importlib

    # On one core nothing takes more workers than it is asked to, and what is imported starts no threads of its own.
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    for module in _HEAVY:
        importlib.import_module(module)
    if len([*Path("/proc/self/task").iterdir()]) > 1:
        sys.exit("cold")  # a fork would lose the threads, and keep the locks that they hold
    gc.freeze()  # nobody walks through them any more
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(f"\0{name}")
    listener.listen()
    sys.stdout.write("warm\n")
    sys.stdout.flush()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody asks how a keeper ended
    while True:
        link, _ = listener.accept()
        if os.fork() == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            listener.close()
            streams, words = _received(link)
            if (pid := os.fork()) == 0:
                _become(streams, *json.loads(words))
                link.close()
                return
            for stream in streams:
                os.close(stream)
            _keep(link, pid)
        link.close()


def _received(link: socket.socket) -> tuple[list[int], bytes]:
    streams = array.array("i")
    head, ancillary, _, _ = link.recvmsg(4, socket.CMSG_LEN(3 * streams.itemsize))
    streams.frombytes(ancillary[0][2])
    rest, left = [], int.from_bytes(head, "big")
    while left:
        rest.append(link.recv(left))
        left -= len(rest[-1])
    return list(streams), b"".join(rest)


def _become(streams: list[int], words: list[str], directory: str, environment: dict[str, str]) -> None:
    """Be as a process that was started by the shell is."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(directory)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["vsnbench", *words]
    sys.path.pop(0)  # this repository's root, which `-m` has put there
    # Processes that it starts import what `vsnbench` itself is, and no test.
    sys.modules["__main__"].__spec__ = None
    sys.modules["__main__"].__file__ = sys.modules["vsnbench.cli.main"].__file__


def _keep(link: socket.socket, pid: int) -> None:
    """Say how a command ended; kill it where whoever typed it is gone."""
    link.sendall(f"{pid}\n".encode())
    while (ended := os.waitpid(pid, os.WNOHANG))[0] == 0:
        if select.select([link], [], [], 0.02)[0]:  # it never says anything more: it is gone
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            os._exit(0)
    with suppress(OSError):
        link.sendall(f"{os.waitstatus_to_exitcode(ended[1]) % 256}\n".encode())
    os._exit(0)


if __name__ == "__main__":
    serve(sys.argv[1])
    from vsnbench.cli.main import main

    try:
        main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    else:
        code = 0
    # As an interpreter ends, but for taking apart what was imported: half a second for each command.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
