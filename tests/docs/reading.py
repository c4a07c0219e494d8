"""Types the commands of a page at a shell, in its own directory."""

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

TIME_LIMIT_S = 240.0
"""For a single command; the slowest takes seconds on an idle machine."""
SMALL_ROBOT = "simulated:turtlebot2@160x120"
"""Default robot: a small image renders in a tenth of the time."""
_STATE_COMMANDS = ("cd ", "export ")
_PROGRESS = re.compile(r"^#\d+ |^\d+ workers: ", re.MULTILINE)
"""A finished episode, or starting workers."""
_ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+/\S*")


class Shell:
    """Types commands one after another; effects of `cd` and `export` stay."""

    def __init__(self, directory: Path, environment: dict[str, str]) -> None:
        """Start in an existing directory, with additional environment variables."""
        self.directory = directory
        self._state: list[str] = []
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
        """Type a command, wait for its end and one of these exit codes, and return its output."""
        with self.running(command) as (shell, log):
            code = shell.wait(TIME_LIMIT_S)
        printed = log.read_text(errors="replace")
        assert code in codes, f"{command}\nended with {code}:\n{printed}"
        assert "Traceback" not in printed, f"{command}\n{printed}"
        if command.startswith(_STATE_COMMANDS):
            self._state.append(command)
        return printed

    def types_and_interrupts(self, command: str) -> str:
        """Type a long command, press Ctrl-C when it makes progress, and return its output."""
        pictures = "episodes/*/rgb/0001.jpg"
        before = len(list(self.directory.rglob(pictures)))
        slow_or_quiet = "--quiet" in command or "--robot" in command
        with self.running(command) as (shell, log):

            def makes_progress() -> bool:
                printed = log.read_text(errors="replace")
                new_picture = slow_or_quiet and len(list(self.directory.rglob(pictures))) > before
                assert shell.poll() in (None, 0), f"{command}\nended with {shell.poll()}:\n{printed}"
                return new_picture or bool(_PROGRESS.search(printed)) or shell.poll() is not None

            wait_until(makes_progress, f"{command} makes progress", TIME_LIMIT_S)
            code = press_ctrl_c(shell)
        printed = log.read_text(errors="replace")
        # A command that is nearly done may finish before the key arrives; a loop returns the code of its last command.
        assert code == 130 or (code == 0 and ("next: vsnbench" in printed or command.startswith("for "))), printed
        assert "Traceback" not in printed, printed
        return printed

    def types_and_visits(self, command: str, code: int) -> str:
        """Type a command that serves a page, load the page, press Ctrl-C, and return the output."""
        with self.running(command) as (shell, log):

            def address() -> "re.Match[str] | None":
                printed = log.read_text(errors="replace")
                assert shell.poll() is None, f"{command}\nended with {shell.poll()}:\n{printed}"
                return _ADDRESS.search(printed)

            wait_until(address, f"{command} prints its address", TIME_LIMIT_S)
            found = address()
            assert found is not None
            browser = urllib.request.build_opener(
                urllib.request.ProxyHandler({}), urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar())
            )
            with browser.open(found[0], timeout=60) as answer:
                assert answer.read().decode().lstrip().lower().startswith("<!doctype html")
            assert press_ctrl_c(shell) == code
        return log.read_text(errors="replace")

    def types_until(self, command: str, text: str, code: int) -> None:
        """Type a command, wait for a text in its output, and press Ctrl-C."""
        with self.running(command) as (shell, log):
            wait_until(
                lambda: text in log.read_text(errors="replace") or shell.poll() is not None,
                f"{command} prints {text}",
                TIME_LIMIT_S,
            )
            assert shell.poll() is None, log.read_text(errors="replace")
            assert press_ctrl_c(shell) == code

    @contextmanager
    def running(self, command: str) -> Iterator[tuple["subprocess.Popen[bytes]", Path]]:
        """Start a command in a new session, as a terminal does, and kill its remaining processes afterwards."""
        self._number += 1
        log = self.directory / ".home" / f"{self._number:02}.log"
        with log.open("wb") as sink:
            shell = subprocess.Popen(
                ["/bin/bash", "-c", "\n".join([*self._state, command, "exit $?"])],
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
    """Interrupt all processes of a shell's session, as a terminal does, and return the exit code."""
    if shell.poll() is None:
        os.killpg(shell.pid, signal.SIGINT)
    return shell.wait(TIME_LIMIT_S)
