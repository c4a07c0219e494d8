"""Prevents a model from ending this process: `os._exit`, `os.abort` and `os.exec*` raise an exception instead.

Native code (a C library that calls `_exit`, a crash, `os.kill`) cannot be prevented here; it needs a separate process
(`--isolate`).
"""

import os
import posix
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

_ENDING: dict[str, Callable[..., NoReturn]] = {
    name: getattr(posix, name) for name in ("_exit", "abort", "execv", "execve")
}
"""The functions that end or replace a process; other functions of `os` call one of these."""


class ProcessExitError(BaseException):
    """Model code tried to end this process. Not an Exception, so that few models catch it."""


_refused: list[str] = []
"""Refused calls that no caller of the model has taken yet."""
_depth = 0


@contextmanager
def process_exit_refused() -> Iterator[None]:
    """Refuse every Python call that would end this process. Forked processes can end normally."""
    global _depth
    _depth += 1
    if _depth == 1:
        for name, ends in _ENDING.items():
            refusal = _refusal(name, ends, os.getpid())
            setattr(os, name, refusal)
            setattr(posix, name, refusal)
    try:
        yield
    finally:
        _depth -= 1
        if _depth == 0:
            for name, ends in _ENDING.items():
                setattr(os, name, ends)
                setattr(posix, name, ends)


def take_refused_exit() -> str:
    """Return a description of the first call refused since the last time, or an empty string.

    Calls count even if the model caught the exception or made them in another thread.
    """
    if not _refused:
        return ""
    call = _refused[0]
    _refused.clear()
    return f"the model called {call}, which would end the whole run"


def _refusal(name: str, ends: Callable[..., NoReturn], owner_pid: int) -> Callable[..., NoReturn]:
    def refuse(*arguments: Any, **keywords: Any) -> NoReturn:
        if os.getpid() != owner_pid:
            ends(*arguments, **keywords)
        status = next(iter((*arguments, *keywords.values())), "") if name == "_exit" else ""
        call = f"os.{name}({status if isinstance(status, int) else ''})"
        _refused.append(call)
        raise ProcessExitError(call)

    return refuse
