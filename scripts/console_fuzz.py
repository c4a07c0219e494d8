"""Sends invalid requests to the page of a run: 10,000 random ones, 300 slow clients, requests of other sites.

    python scripts/console_fuzz.py --requests 10000 --seed 3     about 3 minutes on a busy machine

A blind study of three trials runs twice with the same answers over HTTP: once undisturbed, once with the requests
spread over every screen. No response may be a 5xx or contain a path, a traceback or the token. No request may answer a
question or start the robot. Memory and descriptors must stay bounded, and both runs must record the same. The exit code
is 1 otherwise.
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
from tests.web.blind_study import BlindStudy, wait_until
from tests.web.browser import Browser

LEAKS = re.compile(rb"Traceback|File \"/|site-packages|heron|magpie|\.py\b.*line \d", re.IGNORECASE)
TRIALS = 3
RECORD = (
    "SELECT t.goal, t.start, c.model_id, e.state, e.end_reason, e.actions, v.success, v.author, v.note FROM episode e "
    "JOIN trial t ON t.id = e.trial_id JOIN campaign c ON c.id = t.campaign_id JOIN verdict v ON v.episode_id = e.id "
    "ORDER BY e.id, v.id"
)
MAX_DESCRIPTORS = 400


class HttpOperator:
    """Answers the questions of a run over HTTP."""

    def __init__(self, run: BlindStudy) -> None:
        self.run = run
        self.browser = Browser(run.address, timeout_s=120).enter()
        self.browser.csrf_token = self.state()["csrf_token"]
        answer = self.browser.post("/sign-in", name="Anna")
        self.browser.cookie = answer.headers["set-cookie"].partition(";")[0]

    def state(self) -> Any:
        """Return the session's state."""
        return self.browser.ask("GET", "/state").json

    def question(self) -> Any:
        """Wait for a question, and return the state; None after the end of the run."""
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
        """Answer the current question."""
        number, kind = state["question"]["number"], state["question"]["kind"]
        if kind == "judge":
            episode = state["case"]["episode"]
            form = {"touched": "no", "distance": "0.84"} if episode % 2 else {"touched": "the bin"}
            answer = self.browser.post("/judge", question=number, episode=episode, note="seen", confirmed=True, **form)
        else:
            answer = self.browser.post("/answer", question=number, answer="end" if kind == "finish" else "go")
        assert answer.status == 200, answer


def run_through(directory: Path, between: Any) -> list[tuple[Any, ...]]:
    """Run the study over HTTP with an action at every question, and return the recorded verdicts."""
    directory.mkdir()
    with BlindStudy(directory, TRIALS, 5) as run:
        run.study("lock", "--force")
        run.start()
        run.wait_served()
        operator = HttpOperator(run)
        while (state := operator.question()) is not None:
            between(operator, state)
            operator.answer(state)
            between(operator, None)
        assert run.code == 0, run.log.read_text()
        assert "Traceback" not in run.log.read_text(), run.log.read_text()
        return run.rows(RECORD)


class Attack:
    """Sends invalid requests, and collects faults in the answers."""

    def __init__(self, requests: int, slow: int, seed: int) -> None:
        self.each = max(1, requests // (TRIALS * 4 + 2))
        self.left = requests
        self.slow = slow
        self.chance = random.Random(seed)
        self.statuses: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.max_mb = self.max_descriptors = self.max_wait_s = 0.0

    def at(self, operator: HttpOperator, state: Any) -> None:
        """Send a share of the requests. The current question must stay open."""
        count = min(self.left, self.each) if state is None or state["question"]["kind"] != "finish" else self.left
        if operator.run.code is not None:
            return
        self.left -= count
        process = psutil.Process(operator.run.pid)
        requests = Requests(operator.browser, self.chance)
        with ThreadPoolExecutor(12) as pool:
            for _ in range(count):
                pool.submit(self._send, operator, requests.next())
        if state is None:
            return
        if self.slow:
            self._slow_clients(operator)
            self._other_sites(operator)
            self.slow = 0
        began = time.monotonic()
        now = operator.state()
        self.max_wait_s = max(self.max_wait_s, time.monotonic() - began)
        if (now["question"], now["driving"], now["paused_by"]) != (state["question"], False, ""):
            self.wrong.append(f"{state['question']} became {now['question']}, driving {now['driving']}")
        self.max_mb = max(self.max_mb, process.memory_info().rss / 1e6)
        self.max_descriptors = max(self.max_descriptors, process.num_fds())

    def _send(self, operator: HttpOperator, request: tuple[bytes, str]) -> None:
        sent, ending = request
        received = b""
        with suppress(OSError), socket.create_connection(("127.0.0.1", operator.run.port), timeout=20) as line:
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
        token = operator.run.address.rpartition("=")[2].encode()
        if status.startswith("5") or LEAKS.search(received) or token in received:
            self.wrong.append(f"{sent[:300]!r}: {received[:500]!r}")

    def _slow_clients(self, operator: HttpOperator) -> None:
        """Hold many connections with unfinished requests; the page must still answer."""
        with ExitStack() as stack:
            lines = []
            for _ in range(self.slow):
                line = stack.enter_context(socket.create_connection(("127.0.0.1", operator.run.port), timeout=20))
                line.sendall(b"POST /answer HTTP/1.1\r\nHost: ")
                lines.append(line)
            for _ in range(10):
                for line in lines:
                    with suppress(OSError):
                        line.sendall(b"x")
                began = time.monotonic()
                operator.state()
                self.max_wait_s = max(self.max_wait_s, time.monotonic() - began)
            self.max_descriptors = max(self.max_descriptors, psutil.Process(operator.run.pid).num_fds())

    def _other_sites(self, operator: HttpOperator) -> None:
        """Send requests as pages of other sites, with other host names and tokens."""
        own = operator.browser
        expected: list[tuple[int, dict[str, str], str]] = [
            (403, {**own.own(), "Origin": "http://evil.example"}, ""),
            (403, {"Origin": "http://evil.example", "Content-Type": "text/plain"}, ""),
            (421, own.own(), "evil.example"),
            (421, own.own(), f"evil.example:{operator.run.port}"),
            (403, {**own.own(), "X-CSRF-Token": "0" * 64}, ""),
        ]
        for status, headers, host in expected:
            for path in ("/answer", "/stop", "/judge", "/pause", "/amend"):
                answer = own.ask("POST", path, b'{"answer": "go", "pause": true}', headers, host)
                if answer.status != status:
                    self.wrong.append(f"{path} with {headers} at {host}: {answer.status}")
        for token in ("", "x" * 22, "\u00e9"):
            if (answer := Browser(own.address).ask("GET", f"/?token={token.encode().hex()}")).status != 403:
                self.wrong.append(f"token {token!r}: {answer.status}")


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--requests", type=int, default=10_000)
    options.add_argument("--slow", type=int, default=300, help="clients that never finish a request")
    options.add_argument("--seed", type=int, default=3)
    arguments = options.parse_args()
    attack = Attack(arguments.requests, arguments.slow, arguments.seed)
    with tempfile.TemporaryDirectory() as directory:
        undisturbed = run_through(Path(directory) / "undisturbed", lambda _operator, _state: None)
        began = time.monotonic()
        attacked = run_through(Path(directory) / "attacked", attack.at)
        took_s = time.monotonic() - began
    if attacked != undisturbed:
        attack.wrong += ["the verdicts differ:", *map(str, undisturbed), "became", *map(str, attacked)]
    print(f"{sum(attack.statuses.values())} requests in {took_s:.0f} s: {dict(sorted(attack.statuses.items()))}")
    print(
        f"at most {attack.max_mb:.0f} MB, {attack.max_descriptors:.0f} descriptors, {attack.max_wait_s:.2f} s to answer"
    )
    if attack.left or attack.max_descriptors > MAX_DESCRIPTORS:
        attack.wrong.append(f"{attack.left} requests were not sent, {attack.max_descriptors} descriptors")
    print("\n".join(attack.wrong[:20]) or f"nothing started, nothing leaked; the same {len(undisturbed)} verdicts")
    return 1 if attack.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
