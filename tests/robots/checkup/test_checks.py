"""The check-up judges turns by the odometry, and clocks by the machines of the senders."""

import math

import pytest

from vsnbench.robots.checkup.checks import clock_results, moment_results, rate_result, turn_result
from vsnbench.robots.checkup.result import CheckResult
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.image_timing import rate_needed_hz
from vsnbench.ros.common.interface import CameraTopics
from vsnbench.ros.ros1.interface import ros1_interface
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.camera import CameraRole

NAMES = ros1_interface(load_profile("turtlebot2"))


@pytest.mark.parametrize(
    ("turned_deg", "answered", "health"),
    [
        (30.05, True, "ok"),
        (29.2, True, "warning"),
        (25.6, True, "warning"),
        (24.1, True, "failed"),
        (35.0, True, "failed"),
        (-30.0, True, "failed"),
        (30.0, False, "failed"),
    ],
)
def test_a_turn_is_judged_by_the_odometry(turned_deg: float, answered: bool, health: str) -> None:
    result = turn_result("Left 30°", math.radians(30), math.radians(turned_deg), answered=answered)
    assert result.health == health
    assert bool(result.advice) == (health != "ok")


@pytest.mark.parametrize(
    ("late_s", "remote", "what", "says"),
    [
        (0.03, False, "clocks", "within 30 ms"),
        (0.25, False, "delay", "/odom arrives 0.25 s after its stamps"),
        (0.25, True, "clocks", "0.25 s behind"),
        (-0.25, True, "clocks", "0.25 s ahead"),
        (-0.25, False, "clocks", "stamped 0.25 s ahead of the clock of this machine"),
    ],
)
def test_delay_on_one_machine_is_load_and_not_a_clock(late_s: float, remote: bool, what: str, says: str) -> None:
    messages = {
        topic: TopicMessages(arrivals=[100.0 + late_s], stamps=[100.0], senders={"/driver"})
        for topic in ("/odom", "/camera/color/image_raw", "/camera/depth/image_raw")
    }
    (result,) = clock_results(NAMES, messages, frozenset({"/driver"} if remote else ()))
    assert result.what == what
    assert says in result.seen


def test_images_stamped_ahead_of_the_odometry_fail() -> None:
    messages = {"/odom": TopicMessages(arrivals=[100.0], stamps=[100.0], senders={"/base"})}
    images = ("/camera/color/image_raw", "/camera/depth/image_raw")
    messages |= {topic: TopicMessages(arrivals=[100.0], stamps=[110.0], senders={"/camera"}) for topic in images}
    results = {result.what: result for result in clock_results(NAMES, messages, frozenset())}
    assert results["stamps"].health == "failed"
    assert "differ by 10.00 s" in results["stamps"].seen


COLOR, DEPTH, INFO = "/camera/color/image_raw", "/camera/depth/image_raw", "/camera/color/camera_info"
EVERYWHERE = frozenset({"/base", "/camera"})


def heard(age_s: float, sender: str, rate_hz: float = 30.0, ahead_s: float = 0.0) -> TopicMessages:
    """Return two seconds of messages that arrive `age_s` after their stamps."""
    arrivals = [100.0 + number / rate_hz for number in range(max(2, round(2 * rate_hz)))]
    return TopicMessages(arrivals, [at_s - age_s + ahead_s for at_s in arrivals], [], {sender})


def clocks(
    ages_s: dict[str, float], remote: frozenset[str] = EVERYWHERE, rate_hz: float = 30.0, camera: str = "/camera"
) -> dict[str, CheckResult]:
    messages = {
        topic: heard(age_s, "/base" if topic == "/odom" else camera, rate_hz) for topic, age_s in ages_s.items()
    }
    return {result.what: result for result in clock_results(NAMES, messages, remote)}


def test_images_that_arrive_later_than_other_messages_of_their_node_are_late() -> None:
    for camera, other in (("/camera", INFO), ("/base", "/odom")):
        ages_s = {"/odom": 0.01, COLOR: 0.31, DEPTH: 0.3} | ({INFO: 0.01} if other == INFO else {})
        found = clocks(ages_s, camera=camera)
        assert {what: str(result.health) for what, result in found.items()} == {"delay": "warning"}
        assert f"{COLOR} arrives 0.31 s after its stamps" in found["delay"].seen
        assert "0.01 s after its own" in found["delay"].seen


def test_an_age_that_is_the_same_on_all_topics_of_a_machine_is_a_clock() -> None:
    found = clocks({"/odom": 0.3, COLOR: 0.3, DEPTH: 0.31, INFO: 0.3}, camera="/base")
    assert {what: str(result.health) for what, result in found.items()} == {"clocks": "warning"}
    assert "the clock of the sender of /odom is 0.30 s behind" in found["clocks"].seen


def test_a_node_that_only_sends_late_images_may_have_a_slow_driver_or_another_clock() -> None:
    found = clocks({"/odom": 0.0, COLOR: 0.3, DEPTH: 0.3, INFO: 0.3})
    assert {what: str(result.health) for what, result in found.items()} == {"clocks": "warning"}
    assert "late, or by a clock that is behind" in found["clocks"].seen


def test_a_negative_age_is_a_clock_and_images_ahead_of_the_odometry_fail() -> None:
    found = clocks({"/odom": 0.0, COLOR: -0.3, DEPTH: -0.3, INFO: -0.3})
    assert {what: str(result.health) for what, result in found.items()} == {"clocks": "warning", "stamps": "failed"}
    assert "0.30 s ahead" in found["clocks"].seen


@pytest.mark.parametrize(
    ("delay_s", "rate_hz", "health"), [(2.5, 30, "warning"), (3.2, 30, "failed"), (2.5, 5, "failed")]
)
def test_a_delay_that_leaves_no_time_for_the_images_of_an_observation_fails(
    delay_s: float, rate_hz: float, health: str
) -> None:
    """Ten images of the median within 3.33 s after a motion."""
    found = clocks({"/odom": 0.0, COLOR: delay_s, DEPTH: delay_s, INFO: 0.0}, rate_hz=rate_hz)
    assert str(found["delay"].health) == health


def test_colour_and_depth_without_a_common_time_fail() -> None:
    messages = {"/odom": heard(0, "/base"), COLOR: heard(0, "/camera", 2.0), DEPTH: heard(0.25, "/camera", 2.0)}
    (pairs,) = (result for result in clock_results(NAMES, messages, EVERYWHERE) if result.what == "image pairs")
    assert pairs.health == "failed"
    assert "0.25 s" in pairs.seen


@pytest.mark.parametrize(("rate_hz", "health"), [(30.0, "ok"), (10.0, "warning"), (1.0, "failed")])
def test_a_camera_too_slow_for_an_observation_fails_with_the_rate_it_needs(rate_hz: float, health: str) -> None:
    result = rate_result(DEPTH, "sensor_msgs/Image", heard(0.0, "/camera", rate_hz), 30.0, rate_needed_hz(NAMES, DEPTH))
    assert result.health == health
    assert ("an observation needs 3.0 Hz" in result.seen) == (health == "failed")
    assert f"{rate_hz:.1f} Hz" in result.seen


@pytest.mark.parametrize(
    ("front_hz", "left_hz", "late_s", "health"),
    [(30, 30, 0.03, "ok"), (10, 5, 0.0, "warning"), (5, 5, 0.06, "failed"), (30, 15, 0.0, "ok")],
    ids=["one moment", "unequal rates", "apart", "half the rate within 50 ms"],
)
def test_cameras_of_unequal_rates_are_named(front_hz: float, left_hz: float, late_s: float, health: str) -> None:
    topics = CameraTopics(color="/left/image")
    names = NAMES.model_copy(update={"cameras": {CameraRole.LEFT: topics}})
    stamps = {NAMES.color: (front_hz, 0.0), topics.color: (left_hz, late_s)}
    messages = {
        topic: TopicMessages(*(2 * [[at / hz + late for at in range(int(2 * hz))]]))
        for topic, (hz, late) in stamps.items()
    }
    (result,) = moment_results(names, messages)
    assert (result.what, result.health) == ("left pairs", health)
    if health != "ok":
        assert f"the front camera has {front_hz}.0 Hz, this one {left_hz}.0 Hz" in result.seen
        assert result.advice
