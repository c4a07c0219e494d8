"""Sends hostile web requests to every page that vsnbench serves, and checks them.

    python benchmarks/hostile_requests.py --requests 10000 --seed 3

`run --console` with an open question, `browse`, `report --serve`, `view --web`, `judge --second` and `sites edit` each
get random requests (`scripts/console_requests.py`): malformed HTTP, large headers, paths out of the folder, wrong
methods and hosts, invalid JSON, cut bodies, forged cookies and tokens, web socket garbage, and changes without
permission; meanwhile 60 slow clients hold connections with unfinished requests. No answer may be a 5xx or contain a
traceback, a path or the token; database, images, site file and session must stay as they are, memory within 16 MiB of
what it is after a tenth of the requests, and each page must answer within 10 s. The exit code is 1 otherwise.
"""

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import signal
import socket
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.support.soak_world import Command  # noqa: E402
from scripts.console_requests import CONSOLE, VALUES, Page, Requests  # noqa: E402
from tests.web.browser import Browser  # noqa: E402
from vsnbench.viewer.viewers import free_port  # noqa: E402
from vsnbench.web_server.connections import AUTHENTICATION_TIMEOUT_S  # noqa: E402

LEAKS = re.compile(rb"Traceback|File \"/|site-packages|\.py\b.*line \d", re.IGNORECASE)
SLOW_CLIENTS = 60
MAX_GROWTH_MIB = 16.0
MAX_WAIT_S = 10.0
NUMBERS = (*VALUES, [], [10**9], ["1"], [True], [-1], [2**63], list(range(2000)))
BROWSE = Page(
    paths=(
        *(
            "/data/session.json",
            "/data/version.json",
            "/data/episodes.json",
            "/data/failures.json",
            "/assets/browse.js",
        ),
        *("/data/episode-1.json", "/data/episode-0.json", f"/data/episode-{10**20}.json", "/data/../vsnbench.db"),
        *("/images/1/1.jpg", f"/images/1/{10**20}.jpg", "/images/1/..%2f1.jpg", "/video/9-9-9.mp4", "/video/x.mp4"),
        *("/video/999999999.mp4", "/plan/0.svg", f"/plan/{'a' * 64}.svg", "/plan/..%2f..%2fx.svg", "/annotate"),
    ),
    names=("episodes", "note", "tags", "removed_tags"),
    values=NUMBERS,
)
SECOND = Page(
    paths=("/judge", "/retract", "/skip", "/operator/judging.js", "/operator/..%2fapp.py", "/episodes/x/frames/1"),
    names=("episode", "touched", "distance", "void", "note", "felt", "confirmed"),
)
EDITOR = Page(
    paths=(
        *("/check", "/save", "/preview", "/underlay", "/underlay.png", "/goal-image", "/goal-photo"),
        *("/goal-image?file=../../etc/passwd", "/goal-image?file=/etc/passwd", "/goal-image?file=%00"),
    ),
    names=("site", "x_m", "y_m", "heading_deg", "goal", "image", "map", "name", "underlay"),
    values=(*VALUES, {"walls": [{}]}, {"name": [1]}, {"rooms": [{"polygon": 1}]}, {"walls": [1]}),
    changes=("/save", "/underlay", "/goal-image", "/goal-photo"),
)
VIEWER = Page(paths=("/episode.rrd", "/re_viewer.js", "/..%2fepisode.rrd", "/?url=http://evil.example/x.rrd", "/.."))
REPORT = Page(paths=("/report.html", "/figures/../report.html"))


@dataclass(frozen=True, slots=True)
class Target:
    """A command that serves a page, and its part of the requests."""

    name: str
    words: tuple[str, ...]
    page: Page
    share: float


TARGETS = (
    Target("console", ("run", "--model", "oracle", "--goal", "chair", "--rehearse"), CONSOLE, 0.25),
    Target("browse", ("browse", "--port", "0"), BROWSE, 0.25),
    Target("report", ("report", "--serve"), REPORT, 0.125),
    Target("view", ("view", "1", "--web", "--port", "0"), VIEWER, 0.125),
    Target("second", ("judge", "--second", "Grace", "--port", "0"), SECOND, 0.125),
    Target("editor", ("sites", "edit", "lab.yaml"), EDITOR, 0.125),
)


class Attack:
    """Sends hostile requests to one page, and collects what is wrong."""

    def __init__(self, target: Target, command: Command, count: int, seed: int) -> None:
        self.target = target
        self.count = count
        self.statuses: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.longest_wait_s = 0.0
        self.grown_mib = 0.0
        self._command = command
        address = command.address()
        self._token = address.rpartition("=")[2].encode()
        self._browser = Browser(address, timeout_s=60).enter()
        self._port = int(self._browser.host.rpartition(":")[2])
        with suppress(ValueError, KeyError, TypeError):
            self._browser.csrf_token = json.loads(self._state())["csrf_token"]
        self._requests = Requests(self._browser, random.Random(seed), target.page)

    def run(self) -> None:
        """Send all requests; the page must answer in between."""
        before = self._session()
        self._send_all(self.count // 10)
        settled_mib = self._memory_mib()
        with ExitStack() as stack:
            slow = [stack.enter_context(line) for line in self._slow_clients()]
            self._send_all(self.count - self.count // 10)
            for line in slow:
                with suppress(OSError):
                    line.sendall(b"x")
            self._check_answer()
        self.grown_mib = self._memory_mib() - settled_mib
        if self._session() != before:
            self.wrong.append(f"the session changed: {before} became {self._session()}")
        if self.grown_mib > MAX_GROWTH_MIB:
            self.wrong.append(f"memory grew by {self.grown_mib:.1f} MiB")
        if "Traceback" in self._command.output or LEAKS.search(self._command.output.encode()):
            self.wrong.append(f"the log has a traceback: {self._command.output[-1500:]}")
        if self._command.popen.poll() is not None:
            self.wrong.append(f"the command ended with {self._command.popen.poll()}")

    def _state(self) -> bytes:
        path = {"console": "/state", "second": "/state", "editor": "/state", "browse": "/data/session.json"}
        return self._browser.ask("GET", path.get(self.target.name, "/")).body

    def _session(self) -> object:
        """Return what of the page's state no hostile request may change."""
        if self.target.name in ("report", "view"):
            return None
        state = json.loads(self._state())
        return {name: value for name, value in state.items() if name not in ("now", "clients", "elapsed_s", "revision")}

    def _memory_mib(self) -> float:
        """Return the memory once the server has forgotten the connections of the last requests."""
        time.sleep(AUTHENTICATION_TIMEOUT_S + 2)
        return psutil.Process(self._command.popen.pid).memory_info().rss / 2**20

    def _check_answer(self) -> None:
        began = time.monotonic()
        status = self._browser.ask("GET", "/").status
        self.longest_wait_s = max(self.longest_wait_s, time.monotonic() - began)
        if status not in (200, 307) or self.longest_wait_s > MAX_WAIT_S:
            self.wrong.append(f"the page answers {status} after {self.longest_wait_s:.1f} s")

    def _send_all(self, count: int) -> None:
        with ThreadPoolExecutor(12) as pool:
            for number in range(count):
                pool.submit(self._send, *self._requests.next())
                if number % 250 == 249:
                    self._check_answer()

    def _send(self, sent: bytes, ending: str) -> None:
        received = b""
        with suppress(OSError), socket.create_connection(("127.0.0.1", self._port), timeout=20) as line:
            if ending == "cut":
                line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            line.sendall(sent)
            if ending == "whole":
                line.shutdown(socket.SHUT_WR)
            if ending != "cut":
                while len(received) < 200_000 and (part := line.recv(65536)):
                    received += part
        status = received[9:12].decode("latin-1") if received.startswith(b"HTTP/") else "closed"
        self.statuses[status] += 1
        is_script = b"javascript" in received[:2000] or b"application/wasm" in received[:2000]
        # The viewer of a visitor who has the cookie loads its recording by an address with the token.
        leaks_token = self._token in received and not (status == "307" and self._browser.cookie.encode() in sent)
        if status.startswith("5") or leaks_token or (LEAKS.search(received) and not is_script):
            self.wrong.append(f"{sent[:300]!r}: {received[:500]!r}")

    def _slow_clients(self) -> Iterator[socket.socket]:
        """Open connections with unfinished requests, half of them within a body."""
        head = f"POST /annotate HTTP/1.1\r\nHost: {self._browser.host}\r\nCookie: {self._browser.cookie}\r\n"
        for number in range(SLOW_CLIENTS):
            line = socket.create_connection(("127.0.0.1", self._port), timeout=20)
            line.sendall(head.encode() if number % 2 else f"{head}Content-Length: 100\r\n\r\n{{".encode())
            yield line


def contents(folder: Path) -> str:
    """Return a digest of the record's rows, and of all other files but logs and caches."""
    digest = hashlib.sha256()
    with closing(sqlite3.connect(f"file:{folder / 'results' / 'vsnbench.db'}?mode=ro", uri=True)) as database:
        for (table,) in database.execute(
            "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name"
        ).fetchall():
            names = [row[1] for row in database.execute(f"PRAGMA table_info({table})")]
            kept = ", ".join(name for name in names if name != "lease_until")
            for row in database.execute(f"SELECT {kept} FROM {table} ORDER BY 1"):
                digest.update(repr((table, row)).encode())
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder).parts
        if file.is_file() and inside[0] not in ("tmp", "cache") and not re.search(r"\.log$|\.db(-\w+)?$", file.name):
            digest.update(repr((inside, hashlib.sha256(file.read_bytes()).hexdigest())).encode())
    return digest.hexdigest()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--requests", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=3)
    asked = parser.parse_args()
    os.nice(5)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    wrong: list[str] = []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="vsnbench-hostile-")))
        environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "TMPDIR": str(folder / "tmp"),
            "XDG_CACHE_HOME": str(folder / "cache"),
            "VSNBENCH_RESULTS": "results",
            "VSNBENCH_OPERATOR": "Anna",
        }
        (folder / "tmp").mkdir()
        shutil.copy(ROOT / "sites" / "apartment.yaml", folder / "lab.yaml")
        vsnbench = (sys.executable, "-m", "vsnbench.cli.main")
        trials = ("run", "--model", "oracle", "--goal", "bed", "--starts", "1-4", "--keep", "all", "--workers", "1")
        subprocess.run([*vsnbench, *trials], cwd=folder, env=environment, check=True, capture_output=True)
        commands = []
        for target in TARGETS:
            words = [*target.words, *([f"--console=:{free_port()}"] if target.name == "console" else [])]
            log = folder / f"{target.name}.log"
            with log.open("wb") as sink:
                popen = subprocess.Popen(
                    [*vsnbench, *words], cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=sink, stderr=sink
                )
            commands.append(Command(target.name, popen, log))
            stack.callback(commands[-1].end)
            commands[-1].address()
        time.sleep(5)  # the console asks its question, and `browse` classifies the failures
        before = contents(folder)
        print("| page | requests | answers by status | longest wait | memory |")
        print("| --- | ---: | --- | ---: | ---: |")
        for target, command in zip(TARGETS, commands, strict=True):
            attack = Attack(target, command, round(asked.requests * target.share), asked.seed)
            attack.run()
            statuses = ", ".join(f"{count} × {status}" for status, count in sorted(attack.statuses.items()))
            print(
                f"| {target.name} | {sum(attack.statuses.values())} | {statuses} | {attack.longest_wait_s:.2f} s | "
                f"{attack.grown_mib:+.1f} MiB |",
                flush=True,
            )
            wrong += [f"{target.name}: {fault}" for fault in attack.wrong[:5]]
        if contents(folder) != before:
            wrong.append("the record or a file changed")
    print("\n".join(wrong) or "nothing changed, leaked or stopped")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
