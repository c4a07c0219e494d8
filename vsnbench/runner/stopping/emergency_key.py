"""Keys while the robot drives: the space bar halts it at once and requests the end of the episode."""

import contextlib
import os
import select
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

from vsnbench.runner.stopping.requests import Ends, StopAuthor, StopRequest

KEYS = b" \x1b"
"""Space and Escape."""
PRESSED = StopRequest(StopAuthor.PERSON, "the emergency stop key", Ends.EPISODE)


class EmergencyStop:
    """Listens for the key while it is entered; does nothing if standard input is not a terminal."""

    def __init__(
        self,
        halt: Callable[[], None],
        ask: Callable[[StopRequest], None],
        descriptor: int | None = None,
        others: Mapping[bytes, Callable[[], None]] | None = None,
    ) -> None:
        """Set what a key calls: `halt` for the robot, `ask` for the end of the episode, and `others` by their keys."""
        self._halt = halt
        self._others = others or {}
        self._ask = ask
        self._descriptor = _terminal() if descriptor is None else descriptor
        self._ended = threading.Event()
        self._listening = threading.Event()
        self._thread: threading.Thread | None = None
        self._modes: list[Any] | None = None

    def __enter__(self) -> Self:
        if self._descriptor is not None:
            self._thread = threading.Thread(target=self._run, name="emergency stop", daemon=True)
            self._thread.start()
            self._listen(self._descriptor)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._stop_listening()
        if self._thread is not None:
            self._thread.join(2.0)

    @contextmanager
    def off(self) -> Iterator[None]:
        """Restore the terminal while the operator types an answer."""
        self._stop_listening()
        try:
            yield
        finally:
            if self._descriptor is not None and not self._ended.is_set() and self._thread is not None:
                self._listen(self._descriptor)

    def restore_terminal(self) -> None:
        """Restore the terminal finally, from any thread."""
        self._ended.set()
        self._stop_listening()

    def _listen(self, descriptor: int) -> None:
        """Read keys one at a time without echo; Ctrl-C keeps its meaning."""
        import termios
        import tty

        with contextlib.suppress(termios.error):  # the terminal has closed
            self._modes = termios.tcgetattr(descriptor)
            tty.setcbreak(descriptor)
            self._listening.set()

    def _stop_listening(self) -> None:
        import termios

        self._listening.clear()
        if self._descriptor is not None and self._modes is not None:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._modes)
            self._modes = None

    def _run(self) -> None:
        while not self._ended.is_set():
            if not self._listening.wait(0.1) or self._descriptor is None:
                continue
            ready = select.select([self._descriptor], [], [], 0.05)[0]
            if not ready or not self._listening.is_set():
                continue
            try:
                key = os.read(self._descriptor, 1)
            except OSError:
                return
            if key and key in KEYS:
                # The request comes first because a movement that the halt interrupts would count as a failure of the
                # base. The halt is called from this thread, whatever the main thread is doing.
                self._ask(PRESSED)
                self._halt()
            elif key in self._others:
                self._others[key]()


def _terminal() -> int | None:
    try:
        return sys.stdin.fileno() if sys.stdin.isatty() else None
    except (OSError, ValueError):
        return None
