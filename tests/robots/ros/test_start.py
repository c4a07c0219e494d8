"""The episode of a rehearsed robot begins when the base reports that its wheels are down again."""

from types import SimpleNamespace

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.start import Patience, carry_rehearsed_robot
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.robot_reports import RobotReports
from vsnbench.sites.site import StartingPosition

START = StartingPosition(number=7, position=(2.0, 1.0), heading_deg=90)


class LateWheels:
    """A link whose base reports the lifting only after the simulator's answer."""

    def __init__(self, *, reports_lifting: bool = True) -> None:
        self.reports = RobotReports(load_profile("turtlebot2"))
        self.snapshot, self.clear_events = self.reports.snapshot, self.reports.clear_events
        self.reports_lifting = reports_lifting
        self.placed = 0

    def place(self, *_where: object) -> str:
        self.placed += 1
        return ""

    def wait_for(self, condition, timeout_s):
        for dropped in (True, False):
            assert not condition(self.snapshot())
            for wheel in (0, 1):
                self.reports.take_hazard(Hazard.WHEEL_DROP, wheel, dropped, "left")
        return self.reports.wait_for(condition, timeout_s)


def test_late_reports_of_the_wheels_are_waited_for() -> None:
    link = LateWheels()
    link.reports.take_hazard(Hazard.WHEEL_DROP, 0, True, "left")
    link.reports.take_hazard(Hazard.WHEEL_DROP, 0, False, "left")
    carry_rehearsed_robot(link, START, 5, Patience(5.0))
    assert link.placed == 1
    assert [hazard for hazard, _ in link.snapshot().hazard_events] == [Hazard.WHEEL_DROP] * 2
    assert not link.snapshot().active_hazards


def test_a_base_without_wheel_reports_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    link = LateWheels(reports_lifting=False)
    monkeypatch.setattr(link, "wait_for", SimpleNamespace())
    carry_rehearsed_robot(link, START, 5, Patience(5.0))
    assert link.placed == 1
