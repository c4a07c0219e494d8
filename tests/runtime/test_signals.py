"""A stop signal reaches the main thread at any time, without deadlock."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from vsnbench.runtime.signals import EndAsked

NODE = """
import sys
from vsnbench.runtime.signals import EndAsked
asked = EndAsked().listen()
print("ready", flush=True)
sys.stdin.readline()
print("asked" if asked.wait(0.0) else "runs", flush=True)
"""


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


@pytest.mark.parametrize(
    ("ignored", "sent", "does"), [("HUP", "HUP", "runs"), ("HUP", "TERM", "asked"), ("INT", "INT", "asked")]
)
def test_nohup_is_respected_and_ctrl_c_always_ends(ignored: str, sent: str, does: str) -> None:
    """`nohup` ignores SIGHUP; a shell ignores SIGINT for background jobs of a script."""
    words = ["bash", "-c", f'trap "" {ignored}; exec "$@"', "bash", sys.executable, "-c", NODE]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as node:
        assert node.stdout is not None
        assert node.stdout.readline() == "ready\n"
        node.send_signal(signal.Signals[f"SIG{sent}"])
        assert node.communicate("\n", timeout=30)[0] == f"{does}\n"


def test_processes_of_tests_do_not_inherit_an_ignored_ctrl_c() -> None:
    code = "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "True\n"
