"""Writes what later versions must be able to read: tests/data/releases/VERSION.tar.xz.

usage: python scripts/make_release_data.py [FILE]

Run it at a release (CONTRIBUTING.md). The archive has a results directory with a study, a bundle of it, the reports of
this version, vsnbench_policy.py, and the messages of an episode over the wire. `tests/test_releases.py` opens them.
"""

import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgpack
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection
from websockets.sync.server import serve as serve_websocket

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tests.models.remote.servers import stub_server  # noqa: E402 - importable only after the line above
from vsnbench import __version__  # noqa: E402

PROGRAM = """
import socket, sys
socket.gethostname = lambda: "release"
sys.argv[0] = "vsnbench"
from vsnbench.cli.main import main
main()
"""
"""The command line without the name of this machine."""
ROBOT = "simulated:turtlebot2@64x48"
POLICY = """
class Model:
    card = {"name": "turns", "sensors": ["rgb", "depth", "odometry"]}

    def reset(self, goal, seed):
        self.turns = 0

    def act(self, observation):
        self.turns += 1
        return "STOP" if self.turns > 2 else "TURN_LEFT"
"""


def vsnbench(directory: Path, *words: str) -> str:
    """Run a command in a directory and return its result."""
    environment = {**os.environ, "VSNBENCH_OPERATOR": "Ada", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", PROGRAM, *words, "--quiet"]
    return subprocess.run(
        command, cwd=directory, env=environment, check=True, stdout=subprocess.PIPE, text=True, timeout=600
    ).stdout


def make_record(directory: Path) -> None:
    """Run campaigns and a study, judge an episode, and write a bundle and the reports."""
    run = ("run", "--robot", ROBOT, "--goal", "chair", "--workers", "1")
    vsnbench(directory, *run, "--model", "oracle", "--starts", "1-2")
    vsnbench(directory, *run, "--model", "random", "--starts", "1-2", "--max-steps", "5")
    vsnbench(directory, "judge", "1", "--distance", "0.7", "--yes")
    vsnbench(directory, "note", "2", "the first note", "--tag", "checked")
    design = ("--robot", ROBOT, "--goal", "chair", "--starts", "1-6", "--seed", "7")
    vsnbench(directory, "study", "new", "--arm", "oracle", "--arm", "forward", *design)
    with (directory / "study.yaml").open("a", encoding="utf-8") as plan:
        plan.write("protocol: {max_actions: 8}  # keeps the archive small\n")
    vsnbench(directory, "study", "lock")
    vsnbench(directory, "study", "run", "--unattended")
    vsnbench(directory, "study", "unblind", "--reason", "all trials are done")
    vsnbench(directory, "bundle", "bundle.zip", "--campaign", "1,2")
    (directory / "report.json").write_text(vsnbench(directory, "report", "--json"), encoding="utf-8")
    (directory / "study-report.json").write_text(vsnbench(directory, "study", "report", "--json"), encoding="utf-8")


@contextmanager
def recording_proxy(server: str, messages: list[tuple[str, bytes]]) -> Iterator[str]:
    """Pass messages between a client and a server on, and keep them."""

    def handle(client: ServerConnection) -> None:
        with connect(server, compression=None, max_size=None) as upstream:
            for message in client:
                messages.append(("client", bytes(message)))
                upstream.send(message)
                if msgpack.unpackb(message)["type"] == "bye":
                    return
                messages.append(("server", bytes(upstream.recv())))
                client.send(messages[-1][1])

    with serve_websocket(handle, "127.0.0.1", 0, compression=None, max_size=None) as proxy:
        thread = threading.Thread(target=proxy.serve_forever, daemon=True)
        thread.start()
        yield f"ws://127.0.0.1:{proxy.socket.getsockname()[1]}"
        proxy.shutdown()
        thread.join(5)


def make_wire(directory: Path) -> None:
    """Run an episode over the wire, and keep its messages and the model's side."""
    messages: list[tuple[str, bytes]] = []
    (directory / "server").mkdir()
    with stub_server(POLICY, directory / "server") as (url, _), recording_proxy(url, messages) as proxy:
        words = ("--goal", "chair", "--starts", "1", "--robot", ROBOT, "--workers", "1", "--keep", "none")
        vsnbench(directory, "run", "--model", proxy, *words, "--results", "wire-results")
    shutil.copy(directory / "server" / "vsnbench_policy.py", directory / "vsnbench_policy.py")
    (directory / "exchange.msgpack").write_bytes(msgpack.packb(messages))


def main(target: Path) -> None:
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary)
        make_record(directory)
        make_wire(directory)
        target.parent.mkdir(parents=True, exist_ok=True)
        names = ("results", "study.yaml", "bundle.zip", "report.json", "study-report.json", "vsnbench_policy.py")
        with tarfile.open(target, "w:xz", preset=9) as archive:
            for name in (*names, "exchange.msgpack", *(path.name for path in directory.glob("study.*lock*"))):
                archive.add(directory / name, name, filter=_anonymous)
    print(f"{target}: {target.stat().st_size:,} bytes")


def _anonymous(info: tarfile.TarInfo) -> tarfile.TarInfo:
    info.uid = info.gid = 0
    info.uname = info.gname = ""
    return info


if __name__ == "__main__":
    chosen = sys.argv[1:]
    main(Path(chosen[0]) if chosen else ROOT / "tests" / "data" / "releases" / f"{__version__}.tar.xz")
