"""A base that this process steers and holds still: the hold is stronger than the movement, whatever thread that is."""

import threading
from types import SimpleNamespace

import pytest

from vsnbench.motion.controller import STANDSTILL, Command

pytestmark = pytest.mark.ros2


def test_a_base_that_is_held_still_is_told_to_stand_by_our_own_movement_too() -> None:
    from vsnbench.ros2.robot_link import RobotLink

    sent: list[Command] = []
    link = object.__new__(RobotLink)  # without a graph: only what it sends is looked at
    link._holding = threading.Event()
    link._reports = SimpleNamespace(take_own_command=lambda: None)
    link.velocities = SimpleNamespace(send=sent.append)
    forward = Command(0.3, 0.0)
    link._steer(forward)
    link.hold_still()
    link._steer(forward)
    link.release()
    link._steer(forward)
    assert sent == [forward, STANDSTILL, STANDSTILL, forward]
