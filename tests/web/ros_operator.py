"""An operator who places, starts, watches and judges a rehearsal robot over ROS.

Sends the requests of the page's scripts without a browser.
"""

import hashlib
import re
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from http.client import HTTPException
from pathlib import Path
from typing import Any

from tests.processes import Process, wait_until
from tests.web.browser import Browser
from vsnbench.robots.profiles import embedded_profiles

PATIENCE_S = 150.0
MAX_CHECKS = 8
ATTEMPTS = 4
NAME = "Anna"


@dataclass
class ObservedRehearsal:
    """What the page has shown during a rehearsal."""

    off: list[str] = field(default_factory=list)
    """Offset from the mark, at each check."""
    arrows: list[Any] = field(default_factory=list)
    """Corrections at the first check."""
    is_accepted: bool = False
    most_pictures: int = 0
    """Number of different camera images during one action."""
    judged: str = ""
    """The judged verdict; empty if the episode was void."""
    summary: dict[str, str] = field(default_factory=dict)

    def check(self, output: str) -> None:
        """Check what the page and the terminal have shown."""
        assert "off the mark" in self.off[0], self.off
        assert self.arrows, "corrections are shown"
        assert self.is_accepted, self.off
        assert self.most_pictures >= 3, "the camera image is live during a movement"
        assert self.judged.startswith("success"), self.judged
        assert self.summary["battery"].endswith("%"), self.summary
        assert f"battery {self.summary['battery']}" in output


def written_profile(name: str, directory: Path) -> Path:
    """Write a robot profile with a small camera, and return its path."""
    text = embedded_profiles()[name].read_text()
    text = re.sub(r"width: \d+", "width: 160", re.sub(r"height: \d+", "height: 120", text))
    text = re.sub(r"(kind: ros\d)", r"\1\n  camera_rate_hz: 10\n  depth_frames: 3", text)
    path = directory / f"{name}.yaml"
    path.write_text(text)
    return path


def rehearse(start: Callable[[], Process]) -> tuple[ObservedRehearsal, Process]:
    """Play the operator of a run with one trial until its session ends.

    On a busy machine a sensor can be silent for a second. The episode is then void and runs again; if that ends the
    session, the command is run again.
    """
    seen = ObservedRehearsal()
    for _ in range(ATTEMPTS):
        run = start()
        try:
            _play(run, seen)
        except (OSError, HTTPException):
            wait_until(lambda run=run: run.popen.poll() is not None, "the run has ended", PATIENCE_S)
        code = run.wait(PATIENCE_S)
        if seen.judged:
            break
        assert "the same command resumes" in run.output, run.output
    assert (code, bool(seen.judged)) == (0, True), run.output
    return seen, run


def _play(run: Process, seen: ObservedRehearsal) -> None:
    anna = _signed_in(run)

    def state() -> Any:
        if run.popen.poll() is not None:
            raise ConnectionError("the run has ended")
        return anna.ask("GET", "/state").json

    def asked(*asks: str) -> Any:
        found: list[Any] = []

        def is_asked() -> bool:
            now = state()
            if now["question"] is not None and now["question"]["kind"] in asks and not now["placing"]["in_progress"]:
                found.append(now)
            return bool(found)

        wait_until(is_asked, f"the page asks to {' or '.join(asks)}", PATIENCE_S)
        return found[0]

    while not seen.judged and (now := asked("place", "finish"))["question"]["kind"] == "place":
        _place(anna, asked, state, seen)
        _watch(anna, state, seen)
        now = asked("judge", "place", "finish")  # after a void episode the trial runs again
        if now["question"]["kind"] == "judge":
            case = now["case"]
            form = {"touched": "no", "distance": case["estimate_m"]}
            judged = anna.post("/judge", question=now["question"]["number"], episode=case["episode"], **form)
            assert judged.status == 200, judged
            seen.judged = judged.json["verdict"]
    now = asked("finish")
    seen.summary = dict(anna.ask("GET", "/summary").json["rows"])
    anna.post("/answer", question=now["question"]["number"], answer="end")


def _place(anna: Browser, asked: Callable[..., Any], state: Callable[[], Any], seen: ObservedRehearsal) -> None:
    """Check and correct the placement until it is accepted, and start the trial."""
    checks = 0
    while not (now := asked("place"))["placing"]["within_tolerance"] and checks < MAX_CHECKS:
        checks += 1
        anna.post("/placing", question=now["question"]["number"], action="moved")
        wait_until(lambda before=now: _is_measured(state(), before), "the position is checked", PATIENCE_S)
        placing = asked("place")["placing"]
        seen.off.append(placing["problem"] or placing["headline"])
        seen.arrows = seen.arrows or placing["arrows"]
        seen.is_accepted = placing["within_tolerance"]
    answer = anna.post("/answer", question=asked("place")["question"]["number"], answer="go")
    assert answer.status == 200, answer


def _watch(anna: Browser, state: Callable[[], Any], seen: ObservedRehearsal) -> None:
    """Request camera images while the robot drives."""
    pictures: dict[int, set[str]] = defaultdict(set)
    while (now := state())["driving"]:
        picture = anna.ask("GET", "/picture")
        if picture.status == 200 and state()["actions"] == now["actions"]:
            pictures[now["actions"]].add(hashlib.sha256(picture.body).hexdigest())
        time.sleep(0.1)
    seen.most_pictures = max([seen.most_pictures, *map(len, pictures.values())])


def _is_measured(now: Any, before: Any) -> bool:
    return now["placing"]["is_measured"] and now["placing"]["key"] != before["placing"]["key"]


def _signed_in(run: Process) -> Browser:
    def address() -> Any:
        assert run.popen.poll() is None, run.output
        return re.search(r"http://\S+token=\S+", run.output)

    wait_until(address, "the run logs the page's address", PATIENCE_S)
    anna = Browser(address()[0], timeout_s=60.0).enter()
    anna.csrf_token = anna.ask("GET", "/state").json["csrf_token"]
    anna.cookie = anna.post("/sign-in", name=NAME).headers["set-cookie"].partition(";")[0]
    anna.csrf_token = anna.ask("GET", "/state").json["csrf_token"]
    return anna
