"""Standard output and error streams through which text of unknown origin does not control the terminal."""

import contextlib
import os
import re
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, TextIO

from vsnbench.text.sanitize import without_controls

_COLORS_AND_RETURNS = re.compile(r"(\x1b\[[0-9;]*m|\r)")
_TREATED_AS_TERMINAL_BY = ("FORCE_COLOR", "PY_COLORS", "GITHUB_ACTIONS", "TTY_COMPATIBLE")


class SanitizedStream:
    """A text stream that writes control characters as visible escapes; the rest is the underlying stream's.

    On a terminal, codes of colors and carriage returns pass: help pages and progress bars of libraries use them.
    """

    def __init__(self, stream: TextIO) -> None:
        self.unsanitized = stream
        """The underlying stream."""
        self._is_terminal = stream.isatty() or any(os.environ.get(name) for name in _TREATED_AS_TERMINAL_BY)

    def write(self, text: str) -> int:
        """Write text; returns the number of characters given."""
        self.unsanitized.write(self._sanitized(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def _sanitized(self, text: str) -> str:
        if not self._is_terminal:
            return without_controls(text)
        parts = _COLORS_AND_RETURNS.split(text)  # every second part is one of them
        return "".join(part if number % 2 else without_controls(part) for number, part in enumerate(parts))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unsanitized, name)


@contextmanager
def sanitized_output() -> Iterator[None]:
    """Sanitize what is written to stdout and stderr, and tracebacks, while this is entered.

    Tracebacks stay sanitized afterwards: the interpreter prints the last one.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (SanitizedStream(stream) for stream in before)
    sys.excepthook = _print_traceback
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


@contextmanager
def stdout_as_stderr() -> Iterator[None]:
    """Send what is written to stdout to stderr while this is entered, also by C libraries and new processes."""
    stdout, own = sys.stdout, None
    stdout.flush()
    with contextlib.suppress(OSError, ValueError):  # no descriptor, or it is closed
        if stdout.fileno() == 1:
            own = os.dup(1)
            os.dup2(2, 1)
    sys.stdout = sys.stderr
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stdout = stdout
        if own is not None:
            os.dup2(own, 1)
            os.close(own)


def _print_traceback(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    lines = traceback.format_exception(kind, error, trace)
    sys.stderr.write(without_controls("".join(lines)))
