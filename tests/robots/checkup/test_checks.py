"""The check-up judges turns by the odometry, and clocks by the machines of the senders."""

import math

import pytest

from vsnbench.robots.checkup.checks import clock_results, turn_result
from vsnbench.robots.profiles import load_profile
from vsnbench.ros1.interface import ros1_interface
from vsnbench.sensing.topic_monitor import TopicMessages

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
