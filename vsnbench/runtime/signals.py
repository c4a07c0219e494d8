"""Waiting for a signal or a request to end."""

import queue
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Self


def stop_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end a task: SIGINT, SIGTERM, and SIGHUP unless this process was started to ignore it.

    `nohup` ignores SIGHUP, so that a task survives its terminal. SIGINT counts even if the parent ignores it, as a
    shell does for background jobs of a script: a robot must always be stoppable.
    """
    survives_terminal = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    return (signal.SIGINT, signal.SIGTERM, *(() if survives_terminal else (signal.SIGHUP,)))


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
        """Request the end on each of `stop_signals()`; call this in the main thread."""
        for number in stop_signals():
            signal.signal(number, lambda *_: self.ask())
        return self

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Request the end on each of `stop_signals()` inside the block; restore the previous handlers afterwards."""
        before = {number: signal.getsignal(number) for number in stop_signals()}
        self.listen()
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
