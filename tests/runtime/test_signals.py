"""A stop signal reaches the main thread at any time, without deadlock."""

import os
import signal
import sys
import threading

import pytest

from vsnbench.runtime.signals import EndAsked


def test_a_signal_ends_the_wait_and_handlers_are_put_back() -> None:
    before = signal.getsignal(signal.SIGHUP)
    asked = EndAsked()
    with asked.listening():
        assert not asked.wait(0.0)
        os.kill(os.getpid(), signal.SIGHUP)
        assert asked.wait(30.0)
    assert asked
    assert signal.getsignal(signal.SIGHUP) is before


@pytest.mark.parametrize("line", range(12))
def test_asking_between_any_two_lines_of_a_wait_ends_it(line) -> None:
    """A signal's handler runs between two steps of the code that waits, in the same thread."""
    asked, lines_left = EndAsked(), [line]

    def handler(frame, event, argument):
        if event == "line":
            lines_left[0] -= 1
            if lines_left[0] == 0:
                asked.ask()
        return handler

    def wait() -> None:
        sys.settrace(handler)
        asked.wait(0.1)
        sys.settrace(None)
        asked.ask()

    waiting = threading.Thread(target=wait, daemon=True)
    waiting.start()
    waiting.join(10.0)
    assert not waiting.is_alive()
