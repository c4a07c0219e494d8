"""Waiting for a signal or a request to end."""

import queue
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Self

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class EndAsked:
    """Request to end, from any thread or from a signal handler.

    `threading.Event` is not suitable: its `set` takes a lock that the main thread may hold when the handler interrupts
    its `wait`, which is a deadlock. `SimpleQueue.put` is reentrant (documentation of `queue`).
    """

    def __init__(self) -> None:
        self._wake: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._asked = False

    def __bool__(self) -> bool:
        return self._asked

    def ask(self) -> None:
        """Request the end; repeated requests have no effect."""
        self._asked = True
        self._wake.put(None)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait up to `timeout_s` for a request, in one thread only; return whether there is one."""
        if not self._asked:
            with suppress(queue.Empty):
                self._wake.get(timeout=timeout_s)
        return self._asked

    def listen(self) -> Self:
        """Request the end on SIGINT, SIGTERM and SIGHUP; call this in the main thread."""
        for number in _SIGNALS:
            signal.signal(number, lambda *_: self.ask())
        return self

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Request the end on SIGINT, SIGTERM and SIGHUP inside the block; restore the previous handlers afterwards."""
        before = {number: signal.getsignal(number) for number in _SIGNALS}
        self.listen()
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
