"""Time limits for calls of code of unknown origin, as far as Python allows."""

import ctypes
import signal
import threading
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

_RING_AGAIN_S = 0.2
"""Time after which a call that caught the first interruption is interrupted again."""
_STOP_ATTEMPTS = 20


class TimeLimitError(Exception):
    """A call exceeded its time limit."""


class _TimeIsUp(BaseException):
    """Raised inside a call that exceeds its limit."""


def call_interrupted(function: Callable[[], T], timeout_s: float) -> T:
    """Call a function in this thread and interrupt it by a signal after the time limit.

    The signal interrupts Python code and blocking calls. It does not interrupt a library that computes without
    returning to Python. Only the main thread receives signals: other threads have no limit.

    Raises:
        TimeLimitError: the function took longer, even if it caught the interruption.
    """
    if threading.current_thread() is not threading.main_thread():
        return function()
    is_late = False

    def ring(_number: int, _frame: object) -> None:
        nonlocal is_late
        is_late = True
        raise _TimeIsUp

    handler_before = signal.signal(signal.SIGALRM, ring)
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, timeout_s, _RING_AGAIN_S)
            result = function()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
    except BaseException as error:
        if is_late:
            raise TimeLimitError(f"not finished within {timeout_s:g} s") from error
        raise
    finally:
        signal.signal(signal.SIGALRM, handler_before)
    if is_late:
        raise TimeLimitError(f"not finished within {timeout_s:g} s")
    return result


def call_in_thread(function: Callable[[], T], timeout_s: float) -> T:
    """Call a function in a new thread and continue without it after the time limit.

    A late thread is interrupted in Python code; it may continue if it catches the exception.

    Raises:
        TimeLimitError: the function took longer.
        BaseException: the function raised it.
    """
    outcome: list[tuple[T | None, BaseException | None]] = []

    def call() -> None:
        try:
            outcome.append((function(), None))
        except BaseException as error:
            outcome.append((None, error))

    thread = threading.Thread(target=call, name="call with a time limit", daemon=True)
    try:
        thread.start()
    except (RuntimeError, MemoryError):  # no memory for a thread: call it without a limit
        return function()
    thread.join(timeout_s)
    if not outcome:
        _interrupt(thread)
        raise TimeLimitError(f"not finished within {timeout_s:g} s")
    result, error = outcome[0]
    if error is not None:
        raise error
    return result  # type: ignore[return-value]


def _interrupt(thread: threading.Thread) -> None:
    """Raise an exception in a thread, so that it does not take time from others."""
    set_exception: Any = ctypes.pythonapi.PyThreadState_SetAsyncExc
    for _ in range(_STOP_ATTEMPTS):
        if not thread.is_alive():
            return
        set_exception(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(_TimeIsUp))
        thread.join(0.01)
