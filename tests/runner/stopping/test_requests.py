"""Requests to stop take effect at a safe point; a second signal ends the process."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from vsnbench.runner.stopping.requests import TOGETHER_S, Ends, StopAuthor, Stopped, StopRequest, StopRequests

KEY = StopRequest(StopAuthor.PERSON, "a key", Ends.EPISODE)
PAGE = StopRequest(StopAuthor.PERSON, "the page")


def wait_inside(stop: StopRequests, began: threading.Event) -> None:
    with stop.interruptible():
        began.set()
        threading.Event().wait(30)


def test_a_request_from_another_thread_interrupts_a_safe_block() -> None:
    began = threading.Event()

    def ask() -> None:
        began.wait(30)
        stop.ask(PAGE)

    with StopRequests() as stop:
        threading.Thread(target=ask).start()
        with pytest.raises(Stopped) as raised:
            wait_inside(stop, began)
    assert raised.value.request is PAGE
    assert raised.value.request.description == "stopped with the page"


def test_a_signal_before_a_blocking_call_is_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    with StopRequests() as stop:
        wake, lost = stop._wake, []
        monkeypatch.setattr(stop, "_wake", lambda: wake() if lost else lost.append(1))
        began = threading.Event()
        asking = threading.Thread(target=lambda: (began.wait(30), stop.ask(PAGE)))
        asking.start()
        before_s = time.monotonic()
        with pytest.raises(Stopped):
            wait_inside(stop, began)
        asking.join()
        assert lost
        assert time.monotonic() - before_s < 25, "the wait of thirty seconds was interrupted"


def test_a_request_waits_for_a_safe_point() -> None:
    with StopRequests() as stop:
        stop.ask(KEY)
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Stopped) as raised:
            wait_inside(stop, threading.Event())
    assert raised.value.request.author is StopAuthor.SYSTEM
    assert raised.value.request.description == "the process was ended by SIGTERM"
    assert raised.value.request.exit_code == 143


def test_the_first_signal_halts_a_robot_that_drives_on_without_the_main_thread() -> None:
    halted = threading.Event()
    with StopRequests() as stop:
        stop.at_once = halted.set
        os.kill(os.getpid(), signal.SIGINT)  # outside of a safe block, as in code that does not return
        assert halted.wait(30)
        assert stop.session_ends


def test_an_episode_request_does_not_replace_a_session_request() -> None:
    with StopRequests() as stop:
        stop.ask(PAGE)
        stop.ask(KEY)
        stop.episode_is_over()
        assert stop.session_ends
        with pytest.raises(Stopped):
            wait_inside(stop, threading.Event())


def test_handlers_are_restored_and_threads_end() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGUSR1)
    with StopRequests():
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGUSR1)) == before
    for thread in threading.enumerate():
        if thread.name == "stopping":
            thread.join(30)
            assert not thread.is_alive()


STUBBORN = """
import sys, time
from vsnbench.runner.stopping.requests import Stopped, StopRequests
with StopRequests() as stop:
    stop.last_acts.append(lambda: print("halted", flush=True))
    print("ready", flush=True)
    while True:
        try:
            with stop.interruptible():
                while True:
                    time.sleep(0.01)
        except BaseException as error:
            print(type(error).__name__, flush=True)
            stop._pending = None  # as deaf as code can be
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_halts_the_robot_and_ends_the_process(number: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", STUBBORN], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            process.send_signal(number)
            assert process.stdout.readline() == "Stopped\n"
            time.sleep(TOGETHER_S if number == signal.SIGTERM else 0)
            process.send_signal(number)
            out, err = process.communicate(timeout=30)
        finally:
            process.kill()
    assert process.returncode == 128 + number
    assert "halted" in out
    assert "ended at once" in err


CLOSING = """
import sys, time
from vsnbench.runner.stopping.requests import Stopped, StopRequests
with StopRequests() as stop:
    print("ready", flush=True)
    try:
        with stop.interruptible():
            while True:
                time.sleep(0.01)
    except Stopped:
        sys.stdin.readline()
        print("closed", flush=True)
"""


NOHUP = """
import signal
from vsnbench.runner.stopping.requests import StopRequests
with StopRequests():
    print(signal.getsignal(signal.SIGHUP) is signal.SIG_IGN, signal.getsignal(signal.SIGINT) is signal.SIG_IGN)
"""


def test_a_run_under_nohup_survives_its_terminal_and_still_ends_with_ctrl_c() -> None:
    words = ["bash", "-c", 'trap "" HUP INT; exec "$@"', "bash", sys.executable, "-c", NOHUP]
    assert subprocess.check_output(words, text=True) == "True False\n"


def test_a_signal_to_process_and_group_counts_once() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CLOSING], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGHUP):
                process.send_signal(number)
                time.sleep(0.02)  # the system merges simultaneous signals
            out, _ = process.communicate("\n", timeout=30)
        finally:
            process.kill()
    assert out == "closed\n"
    assert process.returncode == 0
