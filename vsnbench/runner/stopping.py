"""Stopping is a request with an author: Ctrl-C, SIGTERM, the emergency key, a page. It acts at a safe point.

A request interrupts only what runs inside `interruptible()`, never a commit; elsewhere it is remembered until the next
such place. A second signal ends the process for certain, the robot first, whatever the main thread is busy with.
"""

import contextlib
import errno
import os
import signal
import socket
import sys
import termios
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from types import FrameType, TracebackType
from typing import Self

from vsnbench.errors import ExitCode

HALT_TIMEOUT_S = 2.0
"""How long a process that is ended for certain waits for its robot."""
REMINDER_S = 3.0
_REMIND_S = 0.1
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_WAKE = signal.SIGUSR1


class StopAuthor(StrEnum):
    """Who wants a stop."""

    PERSON = "person"
    SYSTEM = "system"
    """Something that ends the process: a shutdown, a terminal that hung up."""


class Ends(StrEnum):
    """What a stop ends."""

    EPISODE = "episode"
    SESSION = "session"


@dataclass(frozen=True, slots=True)
class StopRequest:
    """Somebody wants the robot to stop."""

    author: StopAuthor
    means: str
    """By what: `Ctrl-C`, `the emergency stop key`, `SIGTERM`."""
    ends: Ends = Ends.SESSION
    exit_code: int = ExitCode.INTERRUPTED
    who: str = ""
    """The person's name, where it is known."""

    @property
    def words(self) -> str:
        """What happened, for the record."""
        if self.author is StopAuthor.PERSON:
            return f"stopped with {self.means}{f' by {self.who}' if self.who else ''}"
        return f"the process was ended by {self.means}"


class Stopped(BaseException):
    """A request acts here; not an Exception, so that no model's `except Exception` swallows it."""

    def __init__(self, request: StopRequest) -> None:
        super().__init__(request.words)
        self.request = request


def of_signal(number: int) -> StopRequest:
    """Return the request that a signal is."""
    if number == signal.SIGINT:
        return StopRequest(StopAuthor.PERSON, "Ctrl-C")
    return StopRequest(StopAuthor.SYSTEM, signal.Signals(number).name, exit_code=128 + number)


class Stopping:
    """Takes requests to stop from any thread and from signals while it is entered, by the main thread only."""

    def __init__(self) -> None:
        self.last_acts: list[Callable[[], object]] = []
        """Done in order, each within `HALT_TIMEOUT_S`, before the process is ended for certain: the robot first."""
        self._pending: StopRequest | None = None
        self._acted_on: StopRequest | None = None
        """The request that has last been raised where it could interrupt."""
        self._interruptible = False
        self._previous: dict[int, signal._HANDLER] = {}
        self._main = threading.main_thread().ident
        self._inside = False
        self._ended = threading.Event()
        self._waking = threading.Lock()
        """Held while the main thread is woken: nobody sends a signal when its handler is gone, which ends a process."""

    def __enter__(self) -> Self:
        for number in _SIGNALS:
            self._previous[number] = signal.signal(number, self._received)
        self._previous[_WAKE] = signal.signal(_WAKE, self._woken)
        # Python's handlers wait for the main thread; these bytes are written at once, whatever it is busy with.
        self._told, tells = socket.socketpair()
        tells.setblocking(False)
        self._tells = tells
        self._wakeup_before = signal.set_wakeup_fd(tells.fileno(), warn_on_full_buffer=False)
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
        self._tells.close()  # ends the watching thread, which closes its own end

    @property
    def session_ends(self) -> bool:
        """Whether somebody has asked for the end of the session."""
        return self._pending is not None and self._pending.ends is Ends.SESSION

    def ask(self, request: StopRequest) -> None:
        """Ask for a stop, from any thread. The end of the session is not taken back by the end of an episode."""
        if not self.session_ends:
            self._pending = request
        self._wake()

    def _wake(self) -> None:
        with self._waking:
            if self._inside and self._main is not None:
                signal.pthread_kill(self._main, _WAKE)

    def episode_is_over(self) -> None:
        """Forget a request for the end of the episode: it has ended."""
        if not self.session_ends:
            self._pending = self._acted_on = None

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Let a request interrupt what runs inside; raises `Stopped` at once when one is waiting."""
        self._interruptible = True
        try:
            self._act()
            yield
        finally:
            self._interruptible = False

    def act_now(self) -> None:
        """Raise `Stopped` where a request is waiting: code that is not ours may have swallowed it inside.

        Raises:
            Stopped: there is one.
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
        """Wake the main thread until it has heard.

        A signal that comes after Python has looked for signals and before the system call that waits is found at its
        return only: a wait of thirty seconds would be sat out.
        """
        while not self._ended.wait(_REMIND_S):
            if self._interruptible and self._pending is not self._acted_on:
                self._wake()

    def _watch(self) -> None:
        """Count the signals as they come."""
        signals = 0
        with self._told:
            while not self._ended.is_set():
                self._told.settimeout(REMINDER_S if signals == 1 else None)
                try:
                    came = self._told.recv(1)
                except TimeoutError:
                    signals = max(signals, 1)
                    self._told.settimeout(None)
                    if not self._ended.is_set():
                        _say("still stopping; once more Ctrl-C ends the process at once")
                    came = self._told.recv(1)
                if not came:
                    return
                if came[0] in _SIGNALS:
                    signals += 1
                if signals >= 2 and not self._ended.is_set():
                    self._end_for_certain(came[0])

    def _end_for_certain(self, number: int) -> None:
        for act in self.last_acts:
            thread = threading.Thread(target=_quietly, args=(act,), daemon=True)
            thread.start()
            thread.join(HALT_TIMEOUT_S)
        _say("ended at once: the robot was told to halt; the next start closes the episode as interrupted")
        os._exit(128 + number)


def leave_dead_terminal() -> None:
    """Where the terminal has hung up, let what is still said go nowhere: the record comes first."""
    for descriptor in (0, 1, 2):
        try:
            termios.tcgetattr(descriptor)
        except termios.error as error:
            if error.args[0] == errno.EIO:
                nowhere = os.open(os.devnull, os.O_RDWR)
                os.dup2(nowhere, descriptor)
                os.close(nowhere)


def _quietly(act: Callable[[], object]) -> None:
    with contextlib.suppress(Exception):
        act()


def _say(words: str) -> None:
    """Write past every buffer and lock that the main thread may hold."""
    with contextlib.suppress(OSError, ValueError):
        os.write(sys.stderr.fileno(), f"\r\nvsnbench: {words}\r\n".encode())
