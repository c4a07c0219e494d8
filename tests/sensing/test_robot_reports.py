"""Reports of a robot update the snapshot; invalid reports are logged and change nothing."""

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.robot_reports import RobotReports
from vsnbench.values.pose import Attitude


def test_categories_are_stored_by_number() -> None:
    reports = RobotReports(load_profile("turtlebot2"))
    reports.take_categories('{"1": "chair", "7": "bed"}')
    assert reports.snapshot().categories == {1: "chair", 7: "bed"}


@pytest.mark.parametrize("text", ["", "chair", "[1, 2]", '{"one": "chair"}', "[" * 100_000])
def test_invalid_categories_are_logged_and_change_nothing(text: str, caplog: pytest.LogCaptureFixture) -> None:
    reports = RobotReports(load_profile("turtlebot2"))
    reports.take_categories('{"1": "chair"}')
    reports.take_categories(text)
    assert reports.snapshot().categories == {1: "chair"}
    assert [record.levelname for record in caplog.records] == ["WARNING"]


def test_attitudes_are_kept_in_the_order_of_their_stamps_and_a_fault_drops_them() -> None:
    reports = RobotReports(load_profile("turtlebot2"))
    for stamp_s in (1.0, 1.001, 1.02, 1.04):
        reports.take_attitude(Attitude(0.0, stamp_s / 100), stamp_s)
    assert [attitude.stamp_s for attitude in reports.snapshot().attitudes] == [1.0, 1.02, 1.04]
    reports.take_attitude(Attitude(), 0.5)
    assert [attitude.stamp_s for attitude in reports.snapshot().attitudes] == [0.5], "the clock was set back"
    reports.take_attitude("no attitude", 0.6)
    assert (reports.snapshot().attitudes, reports.snapshot().attitude_fault) == ((), "no attitude")
    reports.take_attitude(Attitude(), 0.7)
    assert (len(reports.snapshot().attitudes), reports.snapshot().attitude_fault) == (1, "")
