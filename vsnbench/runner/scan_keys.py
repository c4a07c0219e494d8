"""A robot driven by hand: each key of the terminal is one movement, and the space bar halts it at once."""

import contextlib
import os
import select
import sys
import threading
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final, Self

from vsnbench.errors import UsageError
from vsnbench.protocol.actions import Action
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runner.scan import ScanState
from vsnbench.runner.scan_drivers import turns_around

HELP: Final = "arrows or w a s d drive, o looks around, space halts, q ends and keeps the map"
_ACTIONS: Final = {
    **dict.fromkeys(("w", "\x1b[A", "\x1bOA"), Action.MOVE_FORWARD),
    **dict.fromkeys(("s", "\x1b[B", "\x1bOB"), Action.MOVE_BACKWARD),
    **dict.fromkeys(("d", "\x1b[C", "\x1bOC"), Action.TURN_RIGHT),
    **dict.fromkeys(("a", "\x1b[D", "\x1bOD"), Action.TURN_LEFT),
}
_WAIT_S: Final = 0.1


class Keys:
    """Listens to a terminal while it is entered; a key that is held down never drives more than one movement ahead."""

    def __init__(self, parameters: ProtocolParameters, halt: Callable[[], None], descriptor: int | None = None) -> None:
        """Drive with the keys of `descriptor`, standard input when None; `halt` is called from another thread.

        Raises:
            UsageError: that is no terminal.
        """
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        if not os.isatty(self._descriptor):
            raise UsageError(
                "driving by hand needs a terminal",
                advice="in simulation --auto drives by itself, and --drive FILE reads its actions from a file",
            )
        self._around = turns_around(parameters)
        self._halt = halt
        self._changed = threading.Condition()
        self._left: deque[Action] = deque()
        self._done = False
        self._ended = threading.Event()
        self._modes: list[Any] | None = None
        self._thread = threading.Thread(target=self._listen, name="keys", daemon=True)

    def __enter__(self) -> Self:
        import termios
        import tty

        self._modes = termios.tcgetattr(self._descriptor)
        tty.setcbreak(self._descriptor)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        import termios

        self._ended.set()
        self._thread.join(2.0)
        if self._modes is not None:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._modes)

    def next(self, state: ScanState) -> Action | None:  # noqa: ARG002 - the person looks
        """Wait for a key, and return its movement; None when the person has ended the scan."""
        with self._changed:
            while not self._left and not self._done:
                self._changed.wait(_WAIT_S)
            return None if self._done else self._left.popleft()

    def _listen(self) -> None:
        while not self._ended.is_set():
            if not select.select([self._descriptor], [], [], _WAIT_S)[0]:
                continue
            try:
                typed = os.read(self._descriptor, 64).decode("ascii", "replace")
            except OSError:
                typed = ""
            for key in _keys_in(typed) if typed else ["q"]:  # a terminal that has gone ends the scan
                self._take(key)
            if not typed:
                return

    def _take(self, key: str) -> None:
        if key == " ":
            with self._changed:
                self._left.clear()
            self._halt()
            return
        with self._changed:
            if key in ("q", "Q"):
                self._done = True
            elif key in ("o", "O"):
                self._left = deque([Action.TURN_LEFT] * self._around)
            elif (action := _ACTIONS.get(key.lower() if len(key) == 1 else key)) is not None:
                self._left = deque([action])
            self._changed.notify_all()


def _keys_in(typed: str) -> list[str]:
    """Split what was read into keys; an arrow is three characters."""
    keys, at = [], 0
    while at < len(typed):
        length = 3 if typed[at] == "\x1b" and typed[at + 1 : at + 2] in ("[", "O") else 1
        keys.append(typed[at : at + length])
        at += length
    return keys
