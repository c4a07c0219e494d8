"""Throws requests at the page of a live run: 10,000 of every broken kind, 300 slow clients, other sites' posts.

    python scripts/console_fuzz.py --requests 10000 --seed 3     about 3 minutes on a busy machine

A blind study of three trials is run twice by the same answers over HTTP: once in peace, once with the requests spread
over every screen of it. No answer may be a 5xx, tell a path, a traceback or the token; no question may be answered, no
robot may start, and what is asked must stay asked; the run's memory and descriptors stay bounded; and its record must
be that of the run in peace. Exits with 1 where it is not so.
"""

import argparse
import random
import re
import socket
import struct
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from scripts.console_requests import Requests
from tests.console.browser import Browser
from tests.console.rehearsal import Rehearsal, wait_until

LEAKS = re.compile(rb"Traceback|File \"/|site-packages|heron|magpie|\.py\b.*line \d", re.IGNORECASE)
TRIALS = 3
RECORD = (
    "SELECT t.goal, t.start, c.model_id, e.state, e.end_reason, e.actions, v.success, v.author, v.note FROM episode e "
    "JOIN trial t ON t.id = e.trial_id JOIN campaign c ON c.id = t.campaign_id JOIN verdict v ON v.episode_id = e.id "
    "ORDER BY e.id, v.id"
)
MOST_GROWTH_MB, MOST_DESCRIPTORS = 150.0, 400


class Clerk:
    """Answers what the run asks, over HTTP, as a phone does."""

    def __init__(self, run: Rehearsal) -> None:
        self.run = run
        self.browser = Browser(run.address, timeout_s=120).enter()
        self.browser.proof = self.state()["proof"]
        signed = self.browser.post("/sign-in", name="Anna")
        self.browser.cookie = signed.headers["set-cookie"].partition(";")[0]

    def state(self) -> Any:
        """Ask what there is."""
        return self.browser.ask("GET", "/state").json

    def question(self) -> Any:
        """Wait until something is asked; None where the run is over."""
        found: list[Any] = []

        def asked() -> bool:
            if self.run.code is not None:
                return True
            with suppress(OSError):
                found[:] = [self.state()]
            return bool(found and found[0]["question"])

        wait_until(asked, "a question")
        return found[0] if self.run.code is None else None

    def answer(self, state: Any) -> None:
        """Say what a person would."""
        number, asks = state["question"]["number"], state["question"]["asks"]
        if asks == "judge":
            episode = state["case"]["episode"]
            word = {"touched": "no", "distance": "0.84"} if episode % 2 else {"touched": "the bin"}
            said = self.browser.post("/judge", question=number, episode=episode, note="seen", sure=True, **word)
        else:
            said = self.browser.post("/answer", question=number, said="end" if asks == "finish" else "go")
        assert said.status == 200, said


def run_through(directory: Path, between: Any) -> list[tuple[Any, ...]]:
    """Run the study by HTTP, with something done at every question; return its record."""
    directory.mkdir()
    with Rehearsal(directory, TRIALS, 5) as run:
        run.study("lock")
        run.start()
        run.wait_served()
        clerk = Clerk(run)
        while (state := clerk.question()) is not None:
            between(clerk, state)
            clerk.answer(state)
            between(clerk, None)
        assert run.code == 0, run.log.read_text()
        assert "Traceback" not in run.log.read_text(), run.log.read_text()
        return run.rows(RECORD)


class Siege:
    """Everything that is thrown, and what was wrong about the answers."""

    def __init__(self, requests: int, slow: int, seed: int) -> None:
        self.each = max(1, requests // (TRIALS * 4 + 2))
        self.left = requests
        self.slow = slow
        self.chance = random.Random(seed)
        self.statuses: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.most_mb = self.most_descriptors = self.longest_s = 0.0

    def at(self, clerk: Clerk, state: Any) -> None:
        """Throw a share of the requests; where something is asked it must still be asked afterwards."""
        count = min(self.left, self.each) if state is None or state["question"]["asks"] != "finish" else self.left
        if clerk.run.code is not None:
            return
        self.left -= count
        process = psutil.Process(clerk.run.pid)
        made = Requests(clerk.browser, self.chance)
        with ThreadPoolExecutor(12) as pool:
            thrown = [pool.submit(self._throw, clerk, made.one()) for _ in range(count)]
        del thrown
        if state is None:
            return
        if self.slow:
            self._slow_clients(clerk)
            self._other_sites(clerk)
            self.slow = 0
        began = time.monotonic()
        now = clerk.state()
        self.longest_s = max(self.longest_s, time.monotonic() - began)
        if (now["question"], now["driving"], now["paused_by"]) != (state["question"], False, ""):
            self.wrong.append(f"{state['question']} became {now['question']}, driving {now['driving']}")
        self.most_mb = max(self.most_mb, process.memory_info().rss / 1e6)
        self.most_descriptors = max(self.most_descriptors, process.num_fds())

    def _throw(self, clerk: Clerk, request: tuple[bytes, str]) -> None:
        sent, ending = request
        said = b""
        with suppress(OSError), socket.create_connection(("127.0.0.1", clerk.run.port), timeout=20) as line:
            if ending == "cut":
                line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            line.sendall(sent)
            if ending == "whole":
                line.shutdown(socket.SHUT_WR)
                while len(said) < 200_000 and (part := line.recv(65536)):
                    said += part
        status = said[9:12].decode("latin-1") if said.startswith(b"HTTP/") else "closed"
        self.statuses[status] += 1
        token = clerk.run.address.rpartition("=")[2].encode()
        if status.startswith("5") or LEAKS.search(said) or token in said:
            self.wrong.append(f"{sent[:300]!r}: {said[:500]!r}")

    def _slow_clients(self, clerk: Clerk) -> None:
        """Hold many connections that never finish a request; the page must answer all the same."""
        with ExitStack() as stack:
            lines = []
            for _ in range(self.slow):
                line = stack.enter_context(socket.create_connection(("127.0.0.1", clerk.run.port), timeout=20))
                line.sendall(b"POST /answer HTTP/1.1\r\nHost: ")
                lines.append(line)
            for _ in range(10):
                for line in lines:
                    with suppress(OSError):
                        line.sendall(b"x")
                began = time.monotonic()
                clerk.state()
                self.longest_s = max(self.longest_s, time.monotonic() - began)
            self.most_descriptors = max(self.most_descriptors, psutil.Process(clerk.run.pid).num_fds())

    def _other_sites(self, clerk: Clerk) -> None:
        """Post as another site's page makes a browser post, come by another name, and with another token."""
        own = clerk.browser
        wanted: list[tuple[int, dict[str, str], str]] = [
            (403, {**own.own(), "Origin": "http://evil.example"}, ""),
            (403, {"Origin": "http://evil.example", "Content-Type": "text/plain"}, ""),
            (421, own.own(), "evil.example"),
            (421, own.own(), f"evil.example:{clerk.run.port}"),
            (403, {**own.own(), "X-Vsnbench-Proof": "0" * 64}, ""),
        ]
        for status, headers, host in wanted:
            for path in ("/answer", "/stop", "/judge", "/pause", "/amend"):
                said = own.ask("POST", path, b'{"said": "go", "pause": true}', headers, host)
                if said.status != status:
                    self.wrong.append(f"{path} with {headers} at {host}: {said.status}")
        for token in ("", "x" * 22, "\u00e9"):
            if (said := Browser(own.address).ask("GET", f"/?token={token.encode().hex()}")).status != 403:
                self.wrong.append(f"token {token!r}: {said.status}")


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--requests", type=int, default=10_000)
    options.add_argument("--slow", type=int, default=300, help="clients that never finish a request")
    options.add_argument("--seed", type=int, default=3)
    asked = options.parse_args()
    siege = Siege(asked.requests, asked.slow, asked.seed)
    with tempfile.TemporaryDirectory() as directory:
        in_peace = run_through(Path(directory) / "peace", lambda _clerk, _state: None)
        began = time.monotonic()
        besieged = run_through(Path(directory) / "siege", siege.at)
        took_s = time.monotonic() - began
    if besieged != in_peace:
        siege.wrong += ["the record is another:", *map(str, in_peace), "became", *map(str, besieged)]
    print(f"{sum(siege.statuses.values())} requests in {took_s:.0f} s: {dict(sorted(siege.statuses.items()))}")
    print(
        f"at most {siege.most_mb:.0f} MB, {siege.most_descriptors:.0f} descriptors, a wait of {siege.longest_s:.2f} s"
    )
    if siege.left or siege.most_descriptors > MOST_DESCRIPTORS:
        siege.wrong.append(f"{siege.left} requests were not sent, {siege.most_descriptors} descriptors")
    print(
        "\n".join(siege.wrong[:20]) or f"nothing started, nothing leaked; the same record of {len(in_peace)} verdicts"
    )
    return 1 if siege.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
