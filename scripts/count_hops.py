"""Counts through how many files a value goes on its way through the house: `python scripts/count_hops.py`.

A run and a report are traced. A file hands a value on when one of its functions calls a function of another file with
it, or returns it there; the value counts, and whatever holds it (a dataclass, a tuple, a mapping). The count of a way
is that of the files on the shortest chain of such hand-overs from where the value comes from to where it ends. Run it
with PYTHONPATH on another checkout to count that one's.
"""

import contextlib
import dataclasses
import io
import json
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import vsnbench

PACKAGE = str(Path(vsnbench.__file__).parent) + "/"
GOAL = "bed"
RUN = f"run --model forward --goal {GOAL} --starts 1 --max-steps 3".split()
_DEEP = 4
_OTHER = ("Site", "ModelCard", "ModelIdentity", "RobotIdentity")
"""Know every goal, not the one that was asked for."""


class Tracer:
    """Notes which file of the package hands a value on to which."""

    def __init__(self, is_the_value: Callable[[Any], bool], *, derived: bool = False) -> None:
        """Note hand-overs of a value.

        Args:
            is_the_value: whether something is it.
            derived: what a function makes of it counts as well.
        """
        self._is_the_value = is_the_value
        self._derived = derived
        self._made: dict[int, Any] = {}
        self._given: dict[int, bool] = {}
        self._busy = threading.local()
        self.hand_overs: set[tuple[str, str]] = set()

    @contextlib.contextmanager
    def tracing(self) -> Iterator[None]:
        """Note hand-overs in every thread that begins meanwhile."""
        threading.setprofile(self._note)
        sys.setprofile(self._note)
        try:
            yield
        finally:
            sys.setprofile(None)
            threading.setprofile(None)  # type: ignore[arg-type]

    def _note(self, frame: FrameType, event: str, returned: Any) -> None:
        file = frame.f_code.co_filename
        if event not in ("call", "return") or not file.startswith(PACKAGE) or getattr(self._busy, "on", False):
            return
        self._busy.on = True
        try:
            if event == "call":
                given = any(self._carries(value, _DEEP) for value in _arguments(frame))
                self._given[id(frame)] = given
                if given:
                    self._hand(_caller(frame), file)
            else:
                given = self._given.pop(id(frame), False)
                if given and self._derived and returned is not None and not isinstance(returned, int | float | str):
                    self._made[id(returned)] = returned
                if self._carries(returned, _DEEP):
                    self._hand(file, _caller(frame))
        finally:
            self._busy.on = False

    def _hand(self, giver: str, taker: str) -> None:
        if giver and giver != taker:
            self.hand_overs.add((giver.removeprefix(PACKAGE), taker.removeprefix(PACKAGE)))

    def _carries(self, value: Any, deep: int) -> bool:
        if id(value) in self._made or self._is_the_value(value):
            return True
        if deep == 0 or value is None or isinstance(value, int | float | str | bytes) or type(value).__name__ in _OTHER:
            return False
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            held = [getattr(value, each.name, None) for each in _fields(value)]
        elif isinstance(value, tuple | list):
            held = list(value)[:4]
        elif type(value) is dict:
            held = list(value.values())[:40]
        else:
            held = list(getattr(value, "args", ())) if type(value).__name__ == "partial" else []
        return any(self._carries(each, deep - 1) for each in held)


def _fields(value: Any) -> list[Any]:
    shown = []
    for each in dataclasses.fields(value):
        with contextlib.suppress(Exception):
            getattr(value, each.name)
            shown.append(each)
    return shown


def _arguments(frame: FrameType) -> list[Any]:
    code = frame.f_code
    count = code.co_argcount + code.co_kwonlyargcount + bool(code.co_flags & 4) + bool(code.co_flags & 8)
    here = frame.f_locals
    return [here[name] for name in code.co_varnames[:count] if name in here]


def _caller(frame: FrameType) -> str:
    """Return the next file of the package up the stack; a thread's first function was called by whoever gave it."""
    above = frame.f_back
    while above is not None:
        if above.f_code.co_filename.startswith(PACKAGE):
            return above.f_code.co_filename
        above = above.f_back
    return ""


def shortest(hand_overs: set[tuple[str, str]], source: str, sink: str) -> list[str]:
    """Return the files on the shortest chain from source to sink; the first in the alphabet where several are."""
    before: dict[str, str] = {source: ""}
    queue = deque([source])
    while queue:
        file = queue.popleft()
        for giver, taker in sorted(hand_overs):
            if giver == file and taker not in before:
                before[taker] = file
                queue.append(taker)
    if sink not in before:
        return []
    chain = [sink]
    while before[chain[-1]]:
        chain.append(before[chain[-1]])
    return chain[::-1]


def is_image(value: Any) -> bool:
    """Whether it is a colour image, its file's content, or what has its hash."""
    if type(value).__name__ == "ndarray":
        return value.ndim == 3 and value.shape[2] == 3 and value.dtype.name == "uint8"
    if isinstance(value, Mapping):
        return value.get("rgb_digest") is not None
    return getattr(value, "rgb_digest", None) is not None


def command(*arguments: str) -> None:
    """Type a command in this process."""
    from vsnbench.cli.main import main

    sys.argv = ["vsnbench", *arguments]
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        main()


def trace(what: Callable[[Any], bool], *arguments: str, derived: bool = False) -> set[tuple[str, str]]:
    """Return who handed the value on to whom while a command ran."""
    tracer = Tracer(what, derived=derived)
    with tracer.tracing():
        command(*arguments)
    return tracer.hand_overs


WAYS = {
    "a camera frame to the database": ("robots/simulated.py", ("database/episodes.py", "database/rows.py")),
    "a goal from the command line to the judge": ("cli/run.py", ("protocol/judge.py", "protocol/metrics.py")),
    "a step back to a table": ("report/record.py", ("report/tables.py",)),
}
"""Where each value comes from, and where it ends: here, or in an older checkout."""


def chains() -> dict[str, list[str]]:
    """Return the files on the shortest chain of each way."""
    with tempfile.TemporaryDirectory() as folder:
        run = (*RUN, "--results", folder)
        frame = trace(is_image, *run)
        again = (*RUN[:-2], "--max-steps", "4", "--results", folder)  # another campaign: its trial is left
        goal = trace(lambda value: isinstance(value, str) and value == GOAL, *again)
        table = trace(lambda value: type(value).__name__ == "DataFrame", "report", "--results", folder, derived=True)
    found = {}
    for (way, (source, sinks)), hand_overs in zip(WAYS.items(), (frame, goal, table), strict=True):
        found[way] = next((chain for sink in sinks if (chain := shortest(hand_overs, source, sink))), [])
    return found


if __name__ == "__main__":
    print(json.dumps(chains(), indent=2))
