"""Requests to stop: Ctrl-C, SIGTERM, the emergency key, a page. They take effect at a safe point.

A request interrupts only code inside `interruptible()`, never a commit; elsewhere it stays pending until the next such
block. A second signal halts the robot and ends the process, whatever the main thread is doing.
"""

import contextlib
import errno
import os
import signal
import socket
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from os import _exit as end_process_now
from types import FrameType, TracebackType
from typing import Self

from vsnbench.errors import ExitCode
from vsnbench.runtime.signals import stop_signals

HALT_TIMEOUT_S = 2.0
"""Time for the robot to halt before the process is forced to end."""
REMINDER_S = 3.0
TOGETHER_S = 0.5
"""SIGTERM and SIGHUP within this time of the first signal belong to it, because `timeout` and service managers signal a
process and then its group. A second Ctrl-C counts at once."""
_REMIND_S = 0.1
_WAKE = signal.SIGUSR1


class StopAuthor(StrEnum):
    """Origin of a request to stop."""

    PERSON = "person"
    SYSTEM = "system"
    """A shutdown, or a terminal that closed."""


class Ends(StrEnum):
    """What a request ends."""

    EPISODE = "episode"
    SESSION = "session"


@dataclass(frozen=True, slots=True)
class StopRequest:
    """A request to stop the robot."""

    author: StopAuthor
    means: str
    """How it was made: `Ctrl-C`, `the emergency stop key`, `SIGTERM`."""
    ends: Ends = Ends.SESSION
    exit_code: int = ExitCode.INTERRUPTED
    who: str = ""
    """Name of the person, if known."""

    @property
    def description(self) -> str:
        """What happened, for the record."""
        if self.author is StopAuthor.PERSON:
            return f"stopped with {self.means}{f' by {self.who}' if self.who else ''}"
        return f"the process was ended by {self.means}"


class Stopped(BaseException):
    """A request takes effect. Not an Exception, so that a model's `except Exception` cannot catch it."""

    def __init__(self, request: StopRequest) -> None:
        super().__init__(request.description)
        self.request = request


def of_signal(number: int) -> StopRequest:
    """Return the request that a signal makes."""
    if number == signal.SIGINT:
        return StopRequest(StopAuthor.PERSON, "Ctrl-C")
    return StopRequest(StopAuthor.SYSTEM, signal.Signals(number).name, exit_code=128 + number)


class StopRequests:
    """Receives requests to stop from any thread and from signals; entered by the main thread."""

    def __init__(self) -> None:
        self.last_acts: list[Callable[[], object]] = []
        """Called in order, each for at most `HALT_TIMEOUT_S`, before the process is forced to end: the robot first."""
        self.at_once: Callable[[], object] | None = None
        """Called in another thread when the first signal arrives: stops a robot that drives on while the main thread
        is in a model's code, which may not return for a while."""
        self._pending: StopRequest | None = None
        self._acted_on: StopRequest | None = None
        """The last request raised inside `interruptible()`."""
        self._interruptible = False
        self._signals: tuple[signal.Signals, ...] = ()
        self._previous: dict[int, signal._HANDLER] = {}
        self._main = threading.main_thread().ident
        self._inside = False
        self._ended = threading.Event()
        self._waking = threading.Lock()
        """Held while the main thread is signalled: without its handler the signal would end the process."""

    def __enter__(self) -> Self:
        self._signals = stop_signals()
        for number in self._signals:
            self._previous[number] = signal.signal(number, self._received)
        self._previous[_WAKE] = signal.signal(_WAKE, self._woken)
        # Python's handlers wait for the main thread; the wakeup descriptor is written at once.
        self._wakeup_read, self._wakeup_write = socket.socketpair()
        self._wakeup_write.setblocking(False)
        self._wakeup_before = signal.set_wakeup_fd(self._wakeup_write.fileno(), warn_on_full_buffer=False)
        threading.Thread(target=self._watch, name="stopping", daemon=True).start()
        self._inside = True
        threading.Thread(target=self._remind, name="stopping, reminder", daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._waking:
            self._inside = False
        self._ended.set()
        signal.set_wakeup_fd(self._wakeup_before)
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._wakeup_write.close()  # ends the watching thread, which closes the other end

    @property
    def session_ends(self) -> bool:
        """Whether the end of the session was requested."""
        return self._pending is not None and self._pending.ends is Ends.SESSION

    def ask(self, request: StopRequest) -> None:
        """Request a stop, from any thread. A request to end an episode does not replace one to end the session."""
        if not self.session_ends:
            self._pending = request
        self._wake()

    def _wake(self) -> None:
        with self._waking:
            if self._inside and self._main is not None:
                signal.pthread_kill(self._main, _WAKE)

    def episode_is_over(self) -> None:
        """Drop a request to end the episode, which has ended."""
        if not self.session_ends:
            self._pending = self._acted_on = None

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Let a request interrupt the block; raises `Stopped` at once if one is pending."""
        self._interruptible = True
        try:
            self._act()
            yield
        finally:
            self._interruptible = False

    def act_now(self) -> None:
        """Raise a pending request, which foreign code may have caught inside `interruptible()`.

        Raises:
            Stopped: a request is pending.
        """
        if self._pending is not None:
            raise Stopped(self._pending)

    def _received(self, number: int, _frame: FrameType | None) -> None:
        leave_dead_terminal()
        if not self.session_ends:
            self._pending = of_signal(number)
        self._act()

    def _woken(self, _number: int, _frame: FrameType | None) -> None:
        self._act()

    def _act(self) -> None:
        if self._interruptible and self._pending is not None:
            self._acted_on = self._pending
            raise Stopped(self._pending)

    def _remind(self) -> None:
        """Signal the main thread until it has raised the request.

        A signal between Python's last check and a blocking system call takes effect only when that call returns.
        """
        while not self._ended.wait(_REMIND_S):
            if self._interruptible and self._pending is not self._acted_on:
                self._wake()

    def _watch(self) -> None:
        """Count signals as they arrive."""
        signals, first_s = 0, 0.0
        with self._wakeup_read:
            while not self._ended.is_set():
                self._wakeup_read.settimeout(REMINDER_S if signals == 1 else None)
                try:
                    received = self._wakeup_read.recv(1)
                except TimeoutError:
                    signals = max(signals, 1)
                    self._wakeup_read.settimeout(None)
                    if not self._ended.is_set():
                        _print_directly("still stopping; another Ctrl-C ends the process at once")
                    received = self._wakeup_read.recv(1)
                if not received:
                    return
                if received[0] in self._signals:
                    first_s = first_s or time.monotonic()
                    if received[0] != signal.SIGINT and signals and time.monotonic() - first_s < TOGETHER_S:
                        continue
                    signals += 1
                    if signals == 1 and self.at_once is not None:
                        threading.Thread(target=_quietly, args=(self.at_once,), daemon=True).start()
                if signals >= 2 and not self._ended.is_set():
                    self._force_end(received[0])

    def _force_end(self, number: int) -> None:
        for act in self.last_acts:
            thread = threading.Thread(target=_quietly, args=(act,), daemon=True)
            thread.start()
            thread.join(HALT_TIMEOUT_S)
        _print_directly("ended at once: the robot was halted; the next run closes the episode as interrupted")
        end_process_now(128 + number)


def leave_dead_terminal() -> None:
    """Redirect the standard streams to /dev/null if their terminal has closed, so that writing to them cannot fail."""
    for descriptor in (0, 1, 2):
        try:
            termios.tcgetattr(descriptor)
        except termios.error as error:
            if error.args[0] == errno.EIO:
                null = os.open(os.devnull, os.O_RDWR)
                os.dup2(null, descriptor)
                os.close(null)


def _quietly(act: Callable[[], object]) -> None:
    with contextlib.suppress(Exception):
        act()


def _print_directly(text: str) -> None:
    """Write to stderr without buffers or locks that the main thread may hold."""
    with contextlib.suppress(OSError, ValueError):
        os.write(sys.stderr.fileno(), f"\r\nvsnbench: {text}\r\n".encode())
