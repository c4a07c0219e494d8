"""Ctrl-C and SIGTERM: stop at a safe point, never in the middle of a commit.

A signal raises only inside `interruptible()`; anywhere else it is remembered and raised at the next such place. A
second Ctrl-C raises wherever it is.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Self


class Stopped(BaseException):
    """Somebody asked the run to stop; not an Exception, so that no model's `except Exception` swallows it."""

    def __init__(self, signal_number: int, *, by_key: bool = False) -> None:
        super().__init__(signal.Signals(signal_number).name)
        self.signal_number = signal_number
        self.by_key = by_key
        """The emergency stop key sent the signal."""

    @property
    def by_person(self) -> bool:
        """Whether a person pressed Ctrl-C or the key, as opposed to something ending the process."""
        return self.signal_number == signal.SIGINT

    @property
    def words(self) -> str:
        """What happened, for the record."""
        if not self.by_person:
            return f"the process was ended by {self}"
        return "stopped with the emergency stop key" if self.by_key else "stopped with Ctrl-C"


class StopSignals:
    """Turns SIGINT, SIGTERM and SIGHUP into `Stopped` while it is entered; the main thread's only."""

    def __init__(self) -> None:
        self._pending: int | None = None
        self._interruptible = False
        self._by_key = False
        self._previous: dict[int, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self._previous[number] = signal.signal(number, self._received)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def key_pressed(self) -> None:
        """Take the next interrupt for the emergency stop key's; called from any thread just before it is sent."""
        self._by_key = True

    def _received(self, number: int, _frame: FrameType | None) -> None:
        again = self._pending is not None and number == signal.SIGINT
        self._pending = number
        if self._interruptible or again:
            raise self._stopped(number)

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Let a signal interrupt what runs inside; raises at once when one is waiting."""
        self._interruptible = True
        try:
            if self._pending is not None:
                raise self._stopped(self._pending)
            yield
        finally:
            self._interruptible = False

    def _stopped(self, number: int) -> Stopped:
        return Stopped(number, by_key=self._by_key and number == signal.SIGINT)
