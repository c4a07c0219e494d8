"""Clients of a soak: an operator on the console's page and a reader of `vsnbench browse`, over HTTP as the pages do."""

import json
import random
import threading
import time
from abc import ABC, abstractmethod
from collections import Counter
from contextlib import suppress
from typing import Any

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from tests.web.browser import Browser

HEARTBEAT_S = 1.0
POLL_S = 1.5
RELOAD_S = 60.0
"""A page is reloaded after this time, which makes a new connection."""


class Client(ABC):
    """A page in a thread of its own; it counts what it did and what the server refused."""

    def __init__(self, address: str) -> None:
        self.counts: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.longest_wait_s = 0.0
        self.browser = Browser(address, timeout_s=60)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the page."""
        self._over.set()
        self._thread.join(30)

    def _run(self) -> None:
        while not self._over.is_set():
            try:
                self.show(time.monotonic() + RELOAD_S)
                self.counts["page loads"] += 1
            except (OSError, WebSocketException, ValueError) as error:
                self.refused[type(error).__name__] += 1
                self._over.wait(1)

    def is_over(self, until_s: float) -> bool:
        """Return whether the page is to be reloaded or closed."""
        return self._over.is_set() or time.monotonic() > until_s

    def wait(self, time_s: float) -> None:
        """Wait, or return at once where the page is closed."""
        self._over.wait(time_s)

    def get(self, path: str) -> bytes:
        """Get a file; what is not 200 is counted."""
        began = time.monotonic()
        answer = self.browser.ask("GET", path)
        self.longest_wait_s = max(self.longest_wait_s, time.monotonic() - began)
        self.counts[f"GET {path.split('/')[1]}"] += 1
        if answer.status != 200:
            self.refused[f"{answer.status} {path.split('/')[1]}"] += 1
            return b"{}"
        return answer.body

    def post(self, path: str, **content: Any) -> None:
        """Post JSON; what is not 200 is counted."""
        status = self.browser.post(path, **content).status
        self.counts[f"POST {path}"] += 1
        if status != 200:
            self.refused[f"{status} {path}"] += 1

    @abstractmethod
    def show(self, until_s: float) -> None:
        """Load the page and use it until a time of the monotonic clock."""


class ConsoleOperator(Client):
    """Confirms each start, watches the camera, and judges each episode."""

    def show(self, until_s: float) -> None:
        """Sign in, follow the session over the web socket, and answer its questions."""
        browser = self.browser.enter()
        for path in ("/", "/assets/operator.js", "/plan.svg"):
            self.get(path)
        browser.csrf_token = json.loads(self.get("/state"))["csrf_token"]
        answer = browser.post("/sign-in", name="Anna")
        browser.cookie = answer.headers["set-cookie"].partition(";")[0]
        with connect(
            f"ws://{browser.host}/live", origin=f"http://{browser.host}", additional_headers={"Cookie": browser.cookie}
        ) as socket:
            self._follow(socket, until_s)

    def _follow(self, socket: ClientConnection, until_s: float) -> None:
        answered, beat, beat_s = -1, 0, 0.0
        while not self.is_over(until_s):
            if time.monotonic() - beat_s >= HEARTBEAT_S:
                beat, beat_s = beat + 1, time.monotonic()
                socket.send(json.dumps({"heartbeat": beat}))
            with suppress(TimeoutError):
                state = json.loads(socket.recv(timeout=0.2))
                self.counts["messages"] += 1
                question = state.get("question")
                if question and question["number"] != answered:
                    answered = question["number"]
                    self._answer(state, question)
                elif state.get("driving"):
                    self.get("/picture")

    def _answer(self, state: dict[str, Any], question: dict[str, Any]) -> None:
        if question["kind"] == "judge":
            case = state["case"]
            content = {"touched": "no", "felt": True} if case["proposal"] else {"void": "no proposal"}
            number = {"question": question["number"], "episode": case["episode"]}
            self.post("/judge", **number, **content, note="soak", confirmed=True)
            if case["episode"] % 20 == 0:
                self.get("/episodes")
                self.get("/summary")
        else:
            self.post("/answer", question=question["number"], answer="end" if question["kind"] == "finish" else "go")


class ResultsReader(Client):
    """Keeps the list of `vsnbench browse` up to date, opens episodes, and adds notes."""

    def show(self, until_s: float) -> None:
        """Load the page and the list, then poll as the page does."""
        browser, chance = self.browser.enter(), random.Random(self.counts["page loads"])
        for path in ("/", "/assets/browse.js"):
            self.get(path)
        browser.csrf_token = json.loads(self.get("/data/session.json"))["csrf_token"]
        version, numbers = "", [1]
        while not self.is_over(until_s):
            now = json.loads(self.get("/data/version.json")).get("version")
            if now != version:
                listed = json.loads(self.get("/data/episodes.json"))
                version, rows = listed.get("version", ""), listed.get("rows", [])
                numbers = [int(row[listed["columns"].index("id")]) for row in rows] or numbers
                self.get("/data/failures.json")
            self._look_at(chance.choice(numbers))
            if chance.random() < 0.05:
                self.post("/annotate", episodes=[chance.choice(numbers)], note="seen", tags=["soak"], removed_tags=[])
            self.wait(POLL_S)

    def _look_at(self, number: int) -> None:
        episode = json.loads(self.get(f"/data/episode-{number}.json"))
        steps = episode.get("steps") or []
        if steps and episode.get("has_images", True):
            self.get(f"/images/{number}/{random.randrange(1, len(steps) + 1)}.jpg")
