"""A console draws its own colors and live displays; text in them stays text."""

import io
import sys

import pytest
from rich.live import Live
from rich.table import Table
from rich.text import Text

from vsnbench.runner.study.output_redaction import OutputRedaction
from vsnbench.text.streams import SanitizedStream
from vsnbench.text.terminal import Console

HOSTILE = "\x1b]0;title\x07x\x9b1A"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def terminal_as_stdout(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    below = Terminal()
    monkeypatch.setattr(sys, "stdout", SanitizedStream(below))
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    return below


def test_text_in_a_table_is_sanitized_and_colors_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = terminal_as_stdout(monkeypatch)
    table = Table()
    table.add_column(Text(HOSTILE))
    table.add_row(Text(HOSTILE, style="red"))
    Console().print(table)
    assert r"\u001b]0;ti" in terminal.getvalue()
    assert "\x1b[31m" in terminal.getvalue()
    assert not set("\x07\x9b") & set(terminal.getvalue())
    assert "\x1b]" not in terminal.getvalue()


def test_a_live_display_moves_the_cursor_and_its_text_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = terminal_as_stdout(monkeypatch)
    console = Console()
    with Live(Text(HOSTILE), console=console, auto_refresh=False) as live:
        live.update(Text(f"two\n{HOSTILE}"), refresh=True)
        sys.stdout.write(f"printed {HOSTILE}\n")
        live.update(Text("end"), refresh=True)
    assert "\x1b[1A" in terminal.getvalue()
    assert "\x1b]0;" not in terminal.getvalue()
    assert "\x9b" not in terminal.getvalue()


def test_a_console_redacts_the_words_of_a_blind_study(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = terminal_as_stdout(monkeypatch)
    console = Console()
    with OutputRedaction(["vlv"]):
        console.print(Text(f"vlv {HOSTILE}", style="red"))
        Console().print("vlv again")
        sys.stdout.write(f"vlv {HOSTILE}\n")
    shown = terminal.getvalue()
    assert "\x1b]0;" not in shown
    assert shown.count("[hidden]") >= 2
    assert "again" in shown
    assert "vlv again" not in shown
