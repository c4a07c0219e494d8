"""Somebody who types a page's commands at a shell, in a directory of the page's own."""

import http.cookiejar
import os
import re
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.processes import wait_until

PATIENCE_S = 240.0
"""For one command; a page's slowest takes seconds on a machine that does nothing else."""
SMALL_ROBOT = "simulated:turtlebot2@160x120"
"""Drives where a command names no robot: a small picture is drawn in a tenth of the time."""
_KEPT = ("cd ", "export ")
_GETS_ON = re.compile(r"^#\d+ |^\d+ actions, |^\d+ workers: ", re.MULTILINE)
"""An episode that has ended, a scan that has seen floor, workers that are on their way."""
_SERVED = re.compile(r"http://127\.0\.0\.1:\d+/\S*")


class Shell:
    """Types commands one after another; what `cd` and `export` did stays."""

    def __init__(self, directory: Path, environment: dict[str, str]) -> None:
        """Begin in a directory that is there, with more environment than a reader has."""
        self.directory = directory
        self._typed: list[str] = []
        self._number = 0
        home = directory / ".home"
        home.mkdir(exist_ok=True)
        kept = {
            name: value
            for name, value in os.environ.items()
            if name not in ("DISPLAY", "WAYLAND_DISPLAY") and not name.startswith(("VSNBENCH_", "PYTEST_"))
        }
        self.environment = kept | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "HOME": str(home),
            "COLUMNS": "80",
            "VSNBENCH_ROBOT": SMALL_ROBOT,
            **environment,
        }

    def types(self, command: str, codes: tuple[int, ...] = (0,)) -> str:
        """Type a command, wait for its end, and return what it said; an exit code that is not one of these fails."""
        with self.running(command) as (shell, log):
            code = shell.wait(PATIENCE_S)
        said = log.read_text(errors="replace")
        assert code in codes, f"{command}\nended with {code}:\n{said}"
        assert "Traceback" not in said, f"{command}\n{said}"
        if command.startswith(_KEPT):
            self._typed.append(command)
        return said

    def begins(self, command: str) -> str:
        """Type a command that takes long, press Ctrl-C when it gets on, and return what it said."""
        pictures = "episodes/*/rgb/0001.jpg"
        before = len(list(self.directory.rglob(pictures)))
        slow_or_quiet = "--quiet" in command or "--robot" in command
        with self.running(command) as (shell, log):

            def gets_on() -> bool:
                said = log.read_text(errors="replace")
                sees = slow_or_quiet and len(list(self.directory.rglob(pictures))) > before
                assert shell.poll() in (None, 0), f"{command}\nended with {shell.poll()}:\n{said}"
                return sees or bool(_GETS_ON.search(said)) or shell.poll() is not None

            wait_until(gets_on, f"{command} gets on", PATIENCE_S)
            code = press_ctrl_c(shell)
        said = log.read_text(errors="replace")
        # What was nearly done may be done before the key is heard; a loop's own code is that of its last command.
        assert code == 130 or (code == 0 and ("next: vsnbench" in said or command.startswith("for "))), said
        assert "Traceback" not in said, said
        return said

    def serves(self, command: str, code: int) -> str:
        """Type a command that serves a page, ask for it once, press Ctrl-C, and return what it said."""
        with self.running(command) as (shell, log):

            def said_where() -> "re.Match[str] | None":
                said = log.read_text(errors="replace")
                assert shell.poll() is None, f"{command}\nended with {shell.poll()}:\n{said}"
                return _SERVED.search(said)

            wait_until(said_where, f"{command} says where its page is", PATIENCE_S)
            where = said_where()
            assert where is not None
            browser = urllib.request.build_opener(
                urllib.request.ProxyHandler({}), urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar())
            )
            with browser.open(where[0], timeout=60) as answer:
                assert answer.read().decode().lstrip().lower().startswith("<!doctype html")
            assert press_ctrl_c(shell) == code
        return log.read_text(errors="replace")

    def says(self, command: str, words: str, code: int) -> None:
        """Type a command that goes on until it is ended, wait for words of it, and press Ctrl-C."""
        with self.running(command) as (shell, log):
            wait_until(
                lambda: words in log.read_text(errors="replace") or shell.poll() is not None,
                f"{command} says {words}",
                PATIENCE_S,
            )
            assert shell.poll() is None, log.read_text(errors="replace")
            assert press_ctrl_c(shell) == code

    @contextmanager
    def running(self, command: str) -> Iterator[tuple["subprocess.Popen[bytes]", Path]]:
        """Start a command in a session of its own, as a terminal would; whatever still runs of it is killed after."""
        self._number += 1
        log = self.directory / ".home" / f"{self._number:02}.log"
        with log.open("wb") as sink:
            shell = subprocess.Popen(
                ["/bin/bash", "-c", "\n".join([*self._typed, command, "exit $?"])],
                cwd=self.directory,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        try:
            yield shell, log
        finally:
            if shell.poll() is None:
                os.killpg(shell.pid, signal.SIGKILL)
                shell.wait()


def press_ctrl_c(shell: "subprocess.Popen[bytes]") -> int:
    """Interrupt whatever runs in a shell's session, as a terminal does, and return the exit code."""
    if shell.poll() is None:
        os.killpg(shell.pid, signal.SIGINT)
    return shell.wait(PATIENCE_S)
