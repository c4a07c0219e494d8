"""The reason for missing images: a silent or slow camera, late images, or another clock."""

from dataclasses import replace

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.image_timing import RateWatch, missing_images, rate_needed_hz, unfit_while_driving
from vsnbench.ros.ros1.interface import ros1_interface
from vsnbench.sensing.images.camera_images import Stamped
from vsnbench.sensing.robot_reports import RobotReports, RobotSnapshot

NAMES = ros1_interface(load_profile("turtlebot2"))
NOW_S = 1000.0
ROBOT_S = 50.0
"""Time on the robot's clock."""


def images(rate_hz: float, age_s: float, since_s: float, kept: int) -> tuple[Stamped[object], ...]:
    """Return the last images of a camera, the newest of which arrived `since_s` ago, `age_s` after its stamp."""
    ago_s = [since_s + number / rate_hz for number in reversed(range(kept))]
    return tuple(Stamped(object(), ROBOT_S - ago - age_s, NOW_S - ago) for ago in ago_s)


def reports(
    rate_hz: float = 30.0, age_s: float = 0.02, since_s: float = 0.01, depth_age_s: float | None = None
) -> RobotSnapshot:
    """Return reports of odometry that arrived just now, and of the images."""
    received = RobotReports(load_profile("turtlebot2"))
    received.take_odometry((0.0, 0.0, 0.0), ROBOT_S, "/odom", "/base")
    (reading,) = received.snapshot().readings
    return replace(
        received.snapshot(),
        readings=(replace(reading, arrival_s=NOW_S),),
        colors=images(rate_hz, age_s, since_s, 6),
        depths=images(rate_hz, age_s if depth_age_s is None else depth_age_s, since_s, 12),
    )


@pytest.mark.parametrize(
    ("now", "code", "says"),
    [
        (RobotSnapshot(), "no-image", "for 3 s"),
        (reports(since_s=2.0), "no-image", "for 2 s"),
        (replace(reports(since_s=2.0), readings=()), "silent-robot", "nothing on /odom"),
        (
            reports(rate_hz=1.0, since_s=0.9),
            "slow-camera",
            "1.0 Hz, and 10 images within 3.3 s after a motion need 3.0 Hz",
        ),
        (reports(rate_hz=5.0, age_s=2.0), "late-images", "2.0 s after its stamps"),
        (reports(age_s=3.5), "late-images", "3.5 s after its stamps"),
        (reports(age_s=86400.0), "no-matching-images", "86400.0 s behind the odometry"),
        (reports(age_s=-10.0), "images-ahead", "10.0 s ahead of the odometry"),
        (reports(depth_age_s=0.5), "no-matching-images", "colour within 0.1 s of depth"),
    ],
    ids=["never", "silent", "robot silent", "slow", "slow and late", "late", "another clock", "ahead", "no pairs"],
)
def test_missing_images_have_a_true_reason(now: RobotSnapshot, code: str, says: str) -> None:
    lost = missing_images(NAMES, now, NOW_S)
    assert lost.code == code
    assert says in lost.statement


@pytest.mark.parametrize(("rate_hz", "since_s", "count", "says"), [(1.0, 0.1, 4, "1.0 Hz"), (0.4, 0.9, 1, "0.6 Hz")])
def test_images_from_before_the_camera_became_slow_do_not_count_as_its_rate(
    rate_hz: float, since_s: float, count: int, says: str
) -> None:
    """Of a single image since then, only an upper limit of the rate is known."""
    now = reports(rate_hz, since_s=since_s)
    fast = images(30.0, 0.02, 3.4, 12 - count)
    lost = missing_images(NAMES, replace(now, depths=(*fast, *now.depths[-count:])), NOW_S)
    assert lost.code == "slow-camera"
    assert f"has {says}" in lost.statement


def test_a_camera_slower_than_the_wait_is_slow() -> None:
    assert missing_images(NAMES, reports(0.2, since_s=4.0), NOW_S).code == "slow-camera"


def test_the_rate_that_an_observation_needs_grows_with_the_delay() -> None:
    assert rate_needed_hz(NAMES, NAMES.depth) == pytest.approx(3.0)
    assert rate_needed_hz(NAMES, NAMES.color) == pytest.approx(0.3)
    assert rate_needed_hz(NAMES, NAMES.depth, 2.0) == pytest.approx(7.5)
    assert rate_needed_hz(NAMES, NAMES.depth, 4.0) == float("inf")


@pytest.mark.parametrize(
    ("age_s", "code"),
    [(0.02, None), (0.3, None), (-0.2, None), (2.0, "clocks-apart"), (-2.0, "clocks-apart"), (ROBOT_S, "no-stamps")],
    ids=["in time", "late", "a little ahead", "behind", "ahead", "without stamps"],
)
def test_a_robot_that_drives_on_needs_images_on_the_clock_of_its_odometry(age_s: float, code: str | None) -> None:
    now = reports(age_s=age_s)
    if code == "no-stamps":
        now = replace(now, depths=tuple(replace(image, stamp_s=0.0) for image in now.depths), colors=())
    fault = unfit_while_driving(NAMES, now)
    assert (None if fault is None else fault.code) == code


def heard(seconds: float, camera_hz: float, before: RobotSnapshot | None = None) -> RobotSnapshot:
    """Return reports after so many seconds more, with odometry at its rate."""
    known = {} if before is None else before.received
    came = {"readings": 50.0, "colors": camera_hz, "depths": camera_hz}
    received = {field: known.get(field, 0) + round(rate_hz * seconds) for field, rate_hz in came.items()}
    return RobotSnapshot(received=received)


def test_a_camera_that_slows_down_during_a_session_is_named_once_until_it_recovers(caplog) -> None:
    watch, now, at_s = RateWatch(NAMES, 50.0), heard(0.0, 0.0), NOW_S
    assert watch.look(now, at_s) == {}
    said = []
    for camera_hz in (30, 30, 30, 9, 9, 9, 9, 30, 30, 30, 9, 9, 9):
        now, at_s = heard(4.0, camera_hz, now), at_s + 4.0
        rates = watch.look(now, at_s)
        said.append(len(caplog.records))
    assert rates == {"odometry_hz": 50.0, "color_hz": 9.0, "depth_hz": 9.0}
    assert said[2] == 0
    assert said[5] == said[6] == 2, "colour and depth"
    assert said[-1] == 4
    assert NAMES.depth in caplog.text
    assert "30 Hz" in caplog.text
