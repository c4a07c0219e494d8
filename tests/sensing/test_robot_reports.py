"""What a robot reports is kept as snapshots; what cannot be read is told, and changes nothing."""

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.robot_reports import RobotReports


def test_categories_come_in_by_their_numbers() -> None:
    reports = RobotReports(load_profile("turtlebot2"))
    reports.take_categories('{"1": "chair", "7": "bed"}')
    assert reports.snapshot().categories == {1: "chair", 7: "bed"}


@pytest.mark.parametrize("text", ["", "chair", "[1, 2]", '{"one": "chair"}', "[" * 100_000])
def test_categories_that_cannot_be_read_are_told_and_change_nothing(
    text: str, caplog: pytest.LogCaptureFixture
) -> None:
    reports = RobotReports(load_profile("turtlebot2"))
    reports.take_categories('{"1": "chair"}')
    reports.take_categories(text)
    assert reports.snapshot().categories == {1: "chair"}
    assert "categories cannot be read" in caplog.text
