"""Model code cannot end its own process, but its forked processes can end."""

import contextlib
import os
import posix
import threading
from collections.abc import Callable

import pytest

from vsnbench.models.process_exit import ProcessExitError, process_exit_refused, take_refused_exit

REAL = os._exit


def leave() -> None:
    with contextlib.suppress(ProcessExitError):
        os._exit(0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: os._exit(0), "os._exit(0)"),
        (lambda: posix._exit(7), "os._exit(7)"),
        (lambda: os._exit(status=3), "os._exit(3)"),
        (lambda: os.abort(), "os.abort()"),  # noqa: PLW0108 - looked up when it is called
        (lambda: os.execvp("true", ["true"]), "os.execv"),
        (lambda: os.execlpe("true", "true", {}), "os.execve"),
    ],
)
def test_a_call_that_would_end_the_process_raises_and_is_kept(call: Callable[[], object], words: str) -> None:
    with process_exit_refused():
        with pytest.raises(ProcessExitError):
            call()
        assert words in take_refused_exit()
        assert take_refused_exit() == ""
    assert os._exit is posix._exit is REAL


def test_an_exit_in_a_thread_of_the_model_is_kept_for_the_next_call() -> None:
    with process_exit_refused(), process_exit_refused():
        thread = threading.Thread(target=leave)
        thread.start()
        thread.join()
        assert "os._exit(0)" in take_refused_exit()


def test_a_forked_child_of_a_model_ends_as_it_likes() -> None:
    with process_exit_refused():
        child = os.fork()
        if child == 0:
            os._exit(9)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert take_refused_exit() == ""
