"""Holding a base that this process steers overrides its movement."""

from types import SimpleNamespace

import pytest

from tests.processes import wait_until
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.sensing.steering import ZeroHold

pytestmark = pytest.mark.ros2


def test_a_hold_overrides_the_movement_of_this_process() -> None:
    from vsnbench.ros.ros2.robot_link import Ros2Link

    sent: list[Command] = []
    link = object.__new__(Ros2Link)  # without a graph: the test only checks what it sends
    link._hold = ZeroHold(link.stand_still)
    link._reports = SimpleNamespace(take_own_command=lambda: None)
    link.velocities = SimpleNamespace(send=sent.append)
    forward = Command(0.3, 0.0)
    link._steer(forward)
    link.hold_still()
    link._steer(forward)
    link.release()
    wait_until(lambda: link._hold._thread is None, "the hold ends")
    link._steer(forward)
    assert [sent[0], sent[-1]] == [forward, forward]
    assert len(sent) >= 4
    assert set(sent[1:-1]) == {STANDSTILL}
