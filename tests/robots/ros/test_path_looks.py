"""The age of a depth image counts from its capture, not from its arrival."""

import time

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.path_looks import captured_ago_s
from vsnbench.sensing.robot_reports import RobotReports, RobotSnapshot

SOURCE = ("/topic", "/node")


def snapshot(image_stamp_s: float, odometry_stamp_s: float | None) -> RobotSnapshot:
    """Return reports of an image and of odometry that both arrived just now."""
    reports = RobotReports(load_profile("turtlebot2"))
    reports.take_image("depths", 1, object(), image_stamp_s, *SOURCE)
    if odometry_stamp_s is not None:
        reports.take_odometry((0.0, 0.0, 0.0), odometry_stamp_s, *SOURCE)
    return reports.snapshot()


@pytest.mark.parametrize(
    ("odometry_stamp_s", "age_s"),
    [(10.0, 0.0), (10.4, 0.4), (9.9, 0.0), (None, 0.0)],
    ids=["equal stamps", "a late image", "odometry is older", "no odometry"],
)
def test_age_of_an_image_that_has_just_arrived(odometry_stamp_s: float | None, age_s: float) -> None:
    now = snapshot(10.0, odometry_stamp_s)
    assert captured_ago_s(now.depths[-1], now) == pytest.approx(age_s, abs=0.05)


def test_age_grows_without_new_messages() -> None:
    now = snapshot(10.0, 10.4)
    before_s = captured_ago_s(now.depths[-1], now)
    time.sleep(0.1)
    assert captured_ago_s(now.depths[-1], now) == pytest.approx(before_s + 0.1, abs=0.05)
