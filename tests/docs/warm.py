"""A `vsnbench` without import time: a server process with all imports done forks for every command.

`python warm.py NAME` serves. The `vsnbench` that `warm_vsnbench` puts on a path sends its arguments, directory,
environment and streams to the server, forwards signals, and ends with the command's exit code.
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
    *("vsnbench.cli.running.run", "vsnbench.cli.results.report", "vsnbench.cli.sites", "vsnbench.cli.study.running"),
    *("vsnbench.runner.setup.launch", "vsnbench.runner.study.session"),
    *("vsnbench.robots.simulated", "vsnbench.report.build"),
    *("vsnbench.models.pirlnav.policy", "vsnbench.models.vlv.policy", "vsnbench.web.operator.page"),
    *("torch", "numba", "onnx", "alembic", "matplotlib.pyplot", "scipy.stats"),
)
_CLIENT = """#!{python} -IS
import array, json, os, signal, socket, sys
if sys.argv[1:] and sys.argv[1].endswith("-completion"):  # asks which shell its parent is
    os.execv({real!r}, [{real!r}, *sys.argv[1:]])
link = socket.socket(socket.AF_UNIX)
link.connect("\\0" + {name!r})
request = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
streams = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [0, 1, 2]))]
link.sendmsg([len(request).to_bytes(4, "big")], streams)
link.sendall(request)
replies = link.makefile()
pid = int(replies.readline())
def forward(number, _):
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        pass  # already ended
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, forward)
sys.exit(int(replies.readline()))
"""


@contextmanager
def warm_vsnbench(directory: Path) -> Iterator[Path]:
    """Serve, and yield a directory for `$PATH` with `vsnbench`; without it if loaded libraries prevent forking."""
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
                client.unlink()  # the installed one is next on the path
            yield directory
        finally:
            server.kill()


def serve(name: str) -> None:
    """Fork for every command until killed; returns in the process that runs the command."""
    import importlib

    from vsnbench.runner.executors import fork_server

    # One core: automatic worker counts stay at 1, and imports start no threads.
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    for module in _HEAVY:
        importlib.import_module(module)
    fork_server._load()
    if len([*Path("/proc/self/task").iterdir()]) > 1:
        sys.exit("cold")  # a fork would lose the threads and keep their locks
    gc.freeze()  # later collections skip the imports
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(f"\0{name}")
    listener.listen()
    sys.stdout.write("warm\n")
    sys.stdout.flush()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # keepers need no wait
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
    """Take over streams, directory, environment and arguments of the shell's process."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(directory)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["vsnbench", *words]
    sys.path.pop(0)  # the repository's root, added by `-m`
    # Child processes import vsnbench, not this test module.
    sys.modules["__main__"].__spec__ = None
    sys.modules["__main__"].__file__ = sys.modules["vsnbench.cli.main"].__file__


def _keep(link: socket.socket, pid: int) -> None:
    """Report a command's exit code; kill it when the client is gone."""
    link.sendall(f"{pid}\n".encode())
    while (ended := os.waitpid(pid, os.WNOHANG))[0] == 0:
        if select.select([link], [], [], 0.02)[0]:  # readable means closed: the client is gone
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
    # Like an interpreter's exit, without half a second of module teardown.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
