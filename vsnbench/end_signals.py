"""Waiting until a person or the system asks for the end with a signal."""

import queue
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Self

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class EndAsked:
    """Whether somebody has asked for the end; any thread may ask, and so may a signal's handler.

    `threading.Event` would not do: its `set` takes a lock which the main thread, whose `wait` the handler interrupts,
    may hold, and both wait for ever. `SimpleQueue.put` may be interrupted by itself (documentation of `queue`).
    """

    def __init__(self) -> None:
        self._wake: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._asked = False

    def __bool__(self) -> bool:
        return self._asked

    def ask(self) -> None:
        """Ask for the end; once more changes nothing."""
        self._asked = True
        self._wake.put(None)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the end is asked for, at most `timeout_s`, for one thread; return whether it is."""
        if not self._asked:
            with suppress(queue.Empty):
                self._wake.get(timeout=timeout_s)
        return self._asked

    def listen(self) -> Self:
        """Let SIGINT, SIGTERM and SIGHUP ask from now on; only in the main thread."""
        for number in _SIGNALS:
            signal.signal(number, lambda *_: self.ask())
        return self

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Let SIGINT, SIGTERM and SIGHUP ask for as long as this lasts, and then do what they did before."""
        before = {number: signal.getsignal(number) for number in _SIGNALS}
        self.listen()
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
