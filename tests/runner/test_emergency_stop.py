"""The emergency stop key, on a real terminal of the test's own."""

import os
import pty
import signal
import termios
import threading

import pytest

from vsnbench.runner.emergency_stop import EmergencyStop
from vsnbench.runner.stopping import Stopped, StopSignals


@pytest.fixture
def terminal():
    master, slave = pty.openpty()
    yield master, slave
    os.close(master)
    os.close(slave)


@pytest.fixture
def interrupted():
    """An event that SIGINT sets."""
    event = threading.Event()
    before = signal.signal(signal.SIGINT, lambda *_: event.set())
    yield event
    signal.signal(signal.SIGINT, before)


def _wait_to_be_stopped(stop: StopSignals) -> None:
    with stop.interruptible():
        threading.Event().wait(10)


def cooked(descriptor: int) -> bool:
    return bool(termios.tcgetattr(descriptor)[3] & termios.ICANON)


@pytest.mark.parametrize("key", [b" ", b"\x1b"])
def test_the_key_interrupts_and_halts_the_robot(terminal, interrupted, key) -> None:
    master, slave = terminal
    halted = threading.Event()
    with EmergencyStop(halted.set, slave):
        os.write(master, key)
        assert interrupted.wait(10)
        assert halted.wait(10)


def test_the_interrupt_is_announced_as_the_key_s_before_it_is_sent(terminal) -> None:
    master, slave = terminal
    with StopSignals() as stop, EmergencyStop(lambda: None, slave, stop.key_pressed):
        os.write(master, b" ")
        with pytest.raises(Stopped) as raised:
            _wait_to_be_stopped(stop)
    assert raised.value.words == "stopped with the emergency stop key"


def test_other_keys_do_nothing(terminal, interrupted) -> None:
    master, slave = terminal
    halted: list[bool] = []
    with EmergencyStop(lambda: halted.append(True), slave):
        os.write(master, b"x")
        os.write(master, b" ")
        assert interrupted.wait(10)
    assert halted == [True]


def test_the_terminal_is_given_back_while_a_person_types_and_at_the_end(terminal) -> None:
    _, slave = terminal
    assert cooked(slave)
    with EmergencyStop(lambda: None, slave) as stop:
        assert not cooked(slave)
        with stop.off():
            assert cooked(slave)
        assert not cooked(slave)
    assert cooked(slave)


def test_without_a_terminal_nothing_listens() -> None:
    before = threading.active_count()
    with EmergencyStop(lambda: None), EmergencyStop(lambda: None) as stop, stop.off():
        assert threading.active_count() == before
