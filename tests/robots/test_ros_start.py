"""A robot that is carried in play: an episode begins when the base has told that it stands on its wheels again."""

from types import SimpleNamespace

import pytest

from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros_start import Patience, have_it_carried
from vsnbench.sensing.discrete_mover import Hazard
from vsnbench.sensing.robot_reports import RobotReports

START = StartingPosition(number=7, position=(2.0, 1.0), heading_deg=90)


class LateWheels:
    """A link whose base tells of the lifting only after the simulator's answer."""

    def __init__(self, *, tells_of_lifting: bool = True) -> None:
        self.reports = RobotReports(load_profile("turtlebot2"))
        self.snapshot, self.clear_events = self.reports.snapshot, self.reports.clear_events
        self.tells_of_lifting = tells_of_lifting
        self.placed = 0

    def place(self, *_where: object) -> str:
        self.placed += 1
        return ""

    def wait_for(self, condition, timeout_s):
        for hanging in (True, False):
            assert not condition(self.snapshot())
            for wheel in (0, 1):
                self.reports.take_hazard(Hazard.WHEEL_DROP, wheel, hanging, "left")
        return self.reports.wait_for(condition, timeout_s)


def test_what_the_wheels_say_late_is_waited_for() -> None:
    link = LateWheels()
    link.reports.take_hazard(Hazard.WHEEL_DROP, 0, True, "left")
    link.reports.take_hazard(Hazard.WHEEL_DROP, 0, False, "left")
    have_it_carried(link, START, 5, Patience(5.0))
    assert link.placed == 1
    assert [hazard for hazard, _ in link.snapshot().hazard_events] == [Hazard.WHEEL_DROP] * 2
    assert not link.snapshot().pressed


def test_a_base_that_tells_nothing_of_its_wheels_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    link = LateWheels(tells_of_lifting=False)
    monkeypatch.setattr(link, "wait_for", SimpleNamespace())
    have_it_carried(link, START, 5, Patience(5.0))
    assert link.placed == 1
