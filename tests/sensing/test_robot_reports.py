"""Reports of a robot update the snapshot; invalid reports are logged and change nothing."""

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.robot_reports import RobotReports


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
