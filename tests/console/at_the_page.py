"""A person at the page of a run whose robot is played over ROS: places it, says go, watches it drive, judges.

Without a browser: what the page's own scripts ask for is asked for here, by the same requests.
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

from tests.console.browser import Browser
from tests.processes import Process, wait_until
from vsnbench.robots.profiles import embedded_profiles

PATIENCE_S = 150.0
MOST_MENDED = 8
ATTEMPTS = 4
NAME = "Anna"


@dataclass
class Rehearsal:
    """What was to be seen at the page."""

    off: list[str] = field(default_factory=list)
    """How far off the mark it stood, at each look."""
    arrows: list[Any] = field(default_factory=list)
    """How to mend that, at the first look."""
    green: bool = False
    most_pictures: int = 0
    """How many different ones were seen in the course of one action of one episode."""
    judged: str = ""
    """What became of the episode by the person's word; empty where it was void."""
    summary: dict[str, str] = field(default_factory=dict)

    def check(self, output: str) -> None:
        """See that it was what a person needs, at the page and at the terminal."""
        assert "off the mark" in self.off[0], self.off
        assert self.arrows, "how to mend it"
        assert self.green, self.off
        assert self.most_pictures >= 3, "the picture goes on in the midst of one movement"
        assert self.judged.startswith("success"), self.judged
        assert self.summary["battery"].endswith("%"), self.summary
        assert f"battery {self.summary['battery']}" in output


def written_profile(name: str, directory: Path) -> Path:
    """Write the profile of a robot whose camera costs little, and return where."""
    text = embedded_profiles()[name].read_text()
    text = re.sub(r"width: \d+", "width: 160", re.sub(r"height: \d+", "height: 120", text))
    text = re.sub(r"(kind: ros\d)", r"\1\n  camera_rate_hz: 10\n  depth_frames: 3", text)
    path = directory / f"{name}.yaml"
    path.write_text(text)
    return path


def rehearse(start: Callable[[], Process]) -> tuple[Rehearsal, Process]:
    """Play the person beside the robot of a run, which has a trial left, to the end of its session.

    On a machine with other work a sensor may fall silent for a second: the episode is void, and comes again; where that
    ends the session, the command is given again, as it says.
    """
    seen = Rehearsal()
    for _ in range(ATTEMPTS):
        run = start()
        try:
            _play(run, seen)
        except (OSError, HTTPException):
            wait_until(lambda run=run: run.popen.poll() is not None, "the run has ended", PATIENCE_S)
        code = run.wait(PATIENCE_S)
        if seen.judged:
            break
        assert "the same command goes on" in run.output, run.output
    assert (code, bool(seen.judged)) == (0, True), run.output
    return seen, run


def _play(run: Process, seen: Rehearsal) -> None:
    anna = _signed_in(run)

    def state() -> Any:
        if run.popen.poll() is not None:
            raise ConnectionError("the run has ended")
        return anna.ask("GET", "/state").json

    def asked(*asks: str) -> Any:
        found: list[Any] = []

        def is_asked() -> bool:
            now = state()
            if now["question"] is not None and now["question"]["asks"] in asks and not now["placing"]["looking"]:
                found.append(now)
            return bool(found)

        wait_until(is_asked, f"the page asks to {' or '.join(asks)}", PATIENCE_S)
        return found[0]

    while not seen.judged and (now := asked("place", "finish"))["question"]["asks"] == "place":
        _place(anna, asked, state, seen)
        _watch(anna, state, seen)
        now = asked("judge", "place", "finish")  # void on a busy machine: the trial comes again
        if now["question"]["asks"] == "judge":
            case = now["case"]
            word = {"touched": "no", "distance": f"{case['estimate_m']:.2f}"}
            judged = anna.post("/judge", question=now["question"]["number"], episode=case["episode"], **word)
            assert judged.status == 200, judged
            seen.judged = judged.json["words"]
    now = asked("finish")
    seen.summary = dict(anna.ask("GET", "/summary").json["rows"])
    anna.post("/answer", question=now["question"]["number"], said="end")


def _place(anna: Browser, asked: Callable[..., Any], state: Callable[[], Any], seen: Rehearsal) -> None:
    """Have it checked and moved until it stands right, and say go."""
    looks = 0
    while not (now := asked("place"))["placing"]["green"] and looks < MOST_MENDED:
        looks += 1
        anna.post("/wish", question=now["question"]["number"], what="moved")
        wait_until(lambda before=now: _looked(state(), before), "it has looked", PATIENCE_S)
        placing = asked("place")["placing"]
        seen.off.append(placing["problem"] or placing["headline"])
        seen.arrows = seen.arrows or placing["arrows"]
        seen.green = placing["green"]
    said = anna.post("/answer", question=asked("place")["question"]["number"], said="go")
    assert said.status == 200, said


def _watch(anna: Browser, state: Callable[[], Any], seen: Rehearsal) -> None:
    """Look at the picture while it drives."""
    pictures: dict[int, set[str]] = defaultdict(set)
    while (now := state())["driving"]:
        picture = anna.ask("GET", "/picture")
        if picture.status == 200 and state()["actions"] == now["actions"]:
            pictures[now["actions"]].add(hashlib.sha256(picture.body).hexdigest())
        time.sleep(0.1)
    seen.most_pictures = max([seen.most_pictures, *map(len, pictures.values())])


def _looked(now: Any, before: Any) -> bool:
    return now["placing"]["seen"] and now["placing"]["key"] != before["placing"]["key"]


def _signed_in(run: Process) -> Browser:
    def address() -> Any:
        assert run.popen.poll() is None, run.output
        return re.search(r"http://\S+token=\S+", run.output)

    wait_until(address, "the run says where its page is", PATIENCE_S)
    anna = Browser(address()[0], timeout_s=60.0).enter()
    anna.proof = anna.ask("GET", "/state").json["proof"]
    anna.cookie = anna.post("/sign-in", name=NAME).headers["set-cookie"].partition(";")[0]
    anna.proof = anna.ask("GET", "/state").json["proof"]
    return anna
