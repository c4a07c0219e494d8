"""The emergency stop key, on a pseudo-terminal."""

import os
import pty
import termios
import threading

import pytest

from vsnbench.runner.stopping.emergency_key import EmergencyStop
from vsnbench.runner.stopping.requests import Ends, StopAuthor, StopRequest


@pytest.fixture
def terminal():
    master, slave = pty.openpty()
    yield master, slave
    os.close(master)
    os.close(slave)


def cooked(descriptor: int) -> bool:
    return bool(termios.tcgetattr(descriptor)[3] & termios.ICANON)


class Asked:
    """Records requests to stop."""

    def __init__(self) -> None:
        self.requests: list[StopRequest] = []
        self.halted = threading.Event()

    def ask(self, request: StopRequest) -> None:
        assert not self.halted.is_set(), "otherwise the halted movement would count as a fault of the base"
        self.requests.append(request)

    def stop_key(self, descriptor: int | None = None) -> EmergencyStop:
        return EmergencyStop(self.halted.set, self.ask, descriptor)


@pytest.mark.parametrize("key", [b" ", b"\x1b"])
def test_the_key_requests_the_end_of_the_episode_and_halts_the_robot(terminal, key) -> None:
    master, slave = terminal
    asked = Asked()
    with asked.stop_key(slave):
        os.write(master, key)
        assert asked.halted.wait(10)
    (request,) = asked.requests
    assert (request.author, request.ends) == (StopAuthor.PERSON, Ends.EPISODE)
    assert request.description == "stopped with the emergency stop key"


def test_another_key_can_have_a_meaning_of_its_own(terminal) -> None:
    master, slave = terminal
    asked, pressed = Asked(), threading.Event()
    with EmergencyStop(asked.halted.set, asked.ask, slave, {b"w": pressed.set}):
        os.write(master, b"w")
        assert pressed.wait(10)
    assert not asked.halted.is_set()


def test_other_keys_do_nothing(terminal) -> None:
    master, slave = terminal
    asked = Asked()
    with asked.stop_key(slave):
        os.write(master, b"x")
        os.write(master, b" ")
        assert asked.halted.wait(10)
    assert len(asked.requests) == 1


def test_the_terminal_is_restored_for_answers_and_at_the_end(terminal) -> None:
    _, slave = terminal
    assert cooked(slave)
    with Asked().stop_key(slave) as stop:
        assert not cooked(slave)
        with stop.off():
            assert cooked(slave)
        assert not cooked(slave)
    assert cooked(slave)


def test_without_a_terminal_no_thread_runs() -> None:
    before = threading.active_count()
    with Asked().stop_key(), Asked().stop_key() as stop, stop.off():
        assert threading.active_count() == before
