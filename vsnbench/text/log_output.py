"""Log messages on stderr and in a file, at the levels of the environment; worker processes inherit both."""

import logging
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from vsnbench.errors import UsageError
from vsnbench.text.sanitize import without_controls

LEVEL_VARIABLE = "VSNBENCH_LOG_LEVEL"
FILE_VARIABLE = "VSNBENCH_LOG_FILE"
LEVELS = ("debug", "info", "warning", "error")


class _FileFormatter(logging.Formatter):
    """UTC time, level, process and logger before each message."""

    converter = time.gmtime  # type: ignore[assignment]
    default_time_format = "%Y-%m-%dT%H:%M:%S"
    default_msec_format = "%s.%03dZ"

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s [%(process)d] %(name)s: %(message)s")

    def format(self, record: logging.LogRecord) -> str:
        return "\n".join(map(without_controls, super().format(record).split("\n")))


class LogOutput:
    """The log handlers of this process."""

    def __init__(self, describe: Callable[[], str] = str) -> None:
        """Log warnings to stderr. `describe` returns the first message in a new log file."""
        self._describe = describe
        self._stderr = logging.StreamHandler(sys.stderr)
        self._stderr.setFormatter(logging.Formatter("vsnbench: %(levelname)s: %(message)s"))
        self._file: logging.FileHandler | None = None

    def open(self) -> None:
        """Log as the environment asks for. May be called again after a change of the environment.

        Raises:
            UsageError: the level is unknown, or the file cannot be written.
        """
        root, level = logging.getLogger(), os.environ.get(LEVEL_VARIABLE, "").lower() or "warning"
        if level not in LEVELS:
            raise UsageError(f"{LEVEL_VARIABLE}={level} is not a log level", advice=f"use one of {', '.join(LEVELS)}")
        if self._stderr not in root.handlers:
            root.addHandler(self._stderr)
        self._stderr.setLevel(level.upper())
        if path := os.environ.get(FILE_VARIABLE):
            self._open_file(Path(path).absolute())
        logging.getLogger("vsnbench").setLevel(min(self._stderr.level, logging.INFO if path else logging.CRITICAL))

    def _open_file(self, path: Path) -> None:
        if self._file is not None and self._file.baseFilename == str(path):
            return
        try:
            file = logging.FileHandler(path, encoding="utf-8")
        except OSError as error:
            raise UsageError(
                f"cannot write the log file {path}: {error.strerror or error}",
                advice="give another file to --log-file",
                code="log-file",
            ) from error
        file.setFormatter(_FileFormatter())
        self._close_file()
        self._file = file
        logging.getLogger().addHandler(file)
        if first := self._describe():
            self.write_to_file(logging.INFO, first)

    def _close_file(self) -> None:
        if self._file is not None:
            logging.getLogger().removeHandler(self._file)
            self._file.close()

    def close(self) -> None:
        """Remove the handlers."""
        self._close_file()
        logging.getLogger().removeHandler(self._stderr)
        logging.getLogger("vsnbench").setLevel(logging.NOTSET)

    def write_to_file(self, level: int, message: str, *, trace: bool = False) -> None:
        """Log a message only to the file, if there is one; with the current traceback if wanted."""
        if self._file is not None:
            info = sys.exc_info() if trace else None
            self._file.handle(logging.LogRecord("vsnbench", level, "", 0, message, None, info))

    @contextmanager
    def quiet(self) -> Iterator[None]:
        """Log nothing to stderr while this is entered; the file is written as before."""
        level = self._stderr.level
        self._stderr.setLevel(logging.CRITICAL + 1)
        try:
            yield
        finally:
            self._stderr.setLevel(level)


_current: LogOutput | None = None


@contextmanager
def opened_log(describe: Callable[[], str] = str) -> Iterator[LogOutput]:
    """Log as the environment asks for while this is entered.

    `describe` returns the first message in a log file, such as the command line.

    Raises:
        UsageError: the level is unknown, or the file cannot be written.
    """
    global _current
    before, _current = _current, LogOutput(describe)
    try:
        _current.open()
        yield _current
    finally:
        _current.close()
        _current = before


def log_more(verbosity: int, file: Path | None) -> None:
    """Log more, in this process and its workers.

    Args:
        verbosity: 1 for the level info, 2 or more for debug, 0 for the level of before.
        file: file to append to; None for the file of before, if any.

    Raises:
        UsageError: the file cannot be written.
    """
    if verbosity:
        os.environ[LEVEL_VARIABLE] = "info" if verbosity == 1 else "debug"
    if file is not None:
        os.environ[FILE_VARIABLE] = str(file.absolute())
    if _current is not None:
        _current.open()


def without_log_on_stderr() -> AbstractContextManager[None]:
    """Return a context in which nothing is logged to stderr; the log file is written as before."""
    return _current.quiet() if _current is not None else nullcontext()
