"""Velocities of other publishers on the command topic, and holding a base at zero velocity against them."""

import threading
import time
from collections.abc import Callable

_HOLD_PERIOD_S = 0.01
_HOLD_S = 1.0
"""Time for which zero velocity is streamed after the hold began, and after each velocity of another publisher."""


def rival_text(publisher: str, topic: str) -> str:
    """Return the fault that another publisher commands the base."""
    return f"{publisher} also commands velocities on {topic}: end it"


class ZeroHold:
    """Streams zero velocity at 100 Hz while another publisher drives a held base.

    A single answer to each velocity is not enough where the base receives the answer first.
    """

    def __init__(self, send_zero: Callable[[], None]) -> None:
        self._send_zero = send_zero
        self._lock = threading.Lock()
        self._held = threading.Event()
        self._until_s = 0.0
        self._thread: threading.Thread | None = None

    @property
    def holding(self) -> bool:
        """Whether the base is held."""
        return self._held.is_set()

    def hold(self) -> None:
        """Send zero velocity, and hold the base until it is released."""
        self._held.set()
        self._stream()

    def release(self) -> None:
        """Allow velocities of others again."""
        self._held.clear()

    def answer(self) -> None:
        """Send zero velocity if the base is held, because another publisher commanded it to move."""
        if self.holding:
            self._stream()

    def _stream(self) -> None:
        self._send_zero()
        with self._lock:
            self._until_s = time.monotonic() + _HOLD_S
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="zero velocity", daemon=True)
                self._thread.start()

    def _run(self) -> None:
        while True:
            with self._lock:
                if not self.holding or time.monotonic() > self._until_s:
                    self._thread = None
                    return
            self._send_zero()
            time.sleep(_HOLD_PERIOD_S)
