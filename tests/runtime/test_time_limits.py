"""Code that never returns is interrupted or abandoned."""

import signal
import threading
import time
from collections.abc import Callable

import pytest

from tests.processes import wait_until
from vsnbench.runtime.time_limits import TimeLimitError, call_in_thread, call_interrupted

LIMITED = [call_interrupted, call_in_thread]


def forever() -> None:
    while True:
        pass


def fail() -> None:
    raise SystemExit("gone")


@pytest.mark.parametrize("limited", LIMITED)
def test_an_endless_loop_is_interrupted(limited: Callable[[Callable[[], None], float], None]) -> None:
    with pytest.raises(TimeLimitError, match=r"within 0\.1 s"):
        limited(forever, 0.1)


@pytest.mark.parametrize("limited", LIMITED)
def test_results_and_exceptions_are_passed_on(
    limited: Callable[[Callable[[], object], float], object],
) -> None:
    assert limited(lambda: 42, 10) == 42
    with pytest.raises(SystemExit, match="gone"):
        limited(fail, 10)


def test_a_call_that_catches_the_first_interruptions_is_interrupted_again() -> None:
    caught = []

    def stubborn() -> None:
        for _ in range(3):
            try:
                time.sleep(10)
            except BaseException as error:
                caught.append(error)

    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(TimeLimitError):
        call_interrupted(stubborn, 0.05)
    assert len(caught) == 3
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is before


def test_a_late_thread_takes_no_more_time() -> None:
    with pytest.raises(TimeLimitError):
        call_in_thread(forever, 0.05)
    wait_until(lambda: all("time limit" not in thread.name for thread in threading.enumerate()), "the thread ends")
