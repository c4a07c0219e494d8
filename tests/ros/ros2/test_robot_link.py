"""Holding a base that this process steers overrides its movement."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from tests.processes import wait_until
from tests.ros.ros2.graph import Domain
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.robots.profiles import load_profile

if TYPE_CHECKING:
    from vsnbench.ros.ros2.robot_link import Ros2Link

pytestmark = pytest.mark.ros2


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Iterator["Ros2Link"]:
    """A workstation in a domain without a robot."""
    from vsnbench.ros.ros2.robot_link import Ros2Link

    domain = Domain()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain.number))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    link = Ros2Link(load_profile("turtlebot4"))
    yield link
    link.close()
    domain.close()


def test_a_hold_overrides_the_movement_of_this_process(link: "Ros2Link") -> None:
    sent: list[Command] = []
    link.velocities = SimpleNamespace(send=sent.append)  # type: ignore[assignment]
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
