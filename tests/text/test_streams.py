"""Output to stdout and stderr cannot control a terminal."""

import io
import subprocess
import sys
from pathlib import Path

import pytest

from vsnbench.text.streams import SanitizedStream, sanitized_output

HOSTILE = "\x1b]0;title\x07\x1b[2J\x9b1Ax\u202ey\x08"
VISIBLE = r"\u001b]0;title\u0007\u001b[2J\u009b1Ax\u202ey\u0008"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def no_forced_colors(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FORCE_COLOR", "PY_COLORS", "GITHUB_ACTIONS", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("kind", [io.StringIO, Terminal])
def test_control_characters_become_visible(kind: type[io.StringIO]) -> None:
    below = kind()
    SanitizedStream(below).write(f"{HOSTILE}\tone\ntwo\r\n")
    assert below.getvalue() == f"{VISIBLE}\tone\ntwo\r\n"


@pytest.mark.parametrize(
    ("kind", "written"),
    [(Terminal, "\r\x1b[1mhelp\x1b[0m"), (io.StringIO, r"\u000d\u001b[1mhelp\u001b[0m")],
)
def test_colors_and_progress_bars_pass_to_a_terminal_only(kind: type[io.StringIO], written: str) -> None:
    below = kind()
    SanitizedStream(below).writelines(["\r\x1b[1mhelp", "\x1b[0m"])
    assert below.getvalue() == written


def test_the_streams_are_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    before = sys.stdout, sys.stderr
    with sanitized_output():
        assert isinstance(sys.stdout, SanitizedStream)
        assert isinstance(sys.stderr, SanitizedStream)
    assert (sys.stdout, sys.stderr) == before


def test_a_traceback_of_a_bug_is_sanitized(tmp_path: Path) -> None:
    program = "from vsnbench.text.streams import *\nwith sanitized_output():\n raise ValueError('\\x1b[2J\\nsecond')"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.endswith("ValueError: \\u001b[2J\nsecond\n")


def test_prints_go_to_stderr_also_those_of_other_processes_and_of_c(tmp_path: Path) -> None:
    program = """
import os
from vsnbench.text.streams import *
with sanitized_output():
    print("before")
    with stdout_as_stderr():
        print("print")
        os.write(1, b"direct\\n")
        os.system("echo child")
    print("after")
    os.write(1, b"direct after\\n")
"""
    done = subprocess.run([sys.executable, "-u", "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "before\nafter\ndirect after\n")
    assert done.stderr == "print\ndirect\nchild\n"
