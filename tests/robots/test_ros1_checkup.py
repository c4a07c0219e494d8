"""How the doctor judges a turn, by what the odometry did, and clocks, by which machine they are on."""

import math

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros1_checkup import clock_results, judge_turn


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
    result = judge_turn("Left 30°", math.radians(30), math.radians(turned_deg), answered=answered)
    assert result.health == health
    assert bool(result.advice) == (health != "ok")


@pytest.mark.ros
@pytest.mark.parametrize(
    ("late_s", "remote", "what", "says"),
    [
        (0.03, False, "clocks", "within 30 ms"),
        (0.25, False, "delay", "one machine, one clock"),
        (0.25, True, "clocks", "0.25 s behind"),
        (-0.25, True, "clocks", "0.25 s ahead"),
        (-0.25, False, "clocks", "stamped 0.25 s ahead of this machine's own clock"),
    ],
)
def test_on_one_machine_lateness_is_load_and_no_clock(late_s: float, remote: bool, what: str, says: str) -> None:
    from vsnbench.sensing.heard import Heard

    heard = {
        topic: Heard(arrivals=[100.0 + late_s], stamps=[100.0], senders={"/driver"})
        for topic in ("/odom", "/camera/color/image_raw", "/camera/depth/image_raw")
    }
    (result,) = clock_results(load_profile("turtlebot2"), heard, frozenset({"/driver"} if remote else ()))
    assert result.what == what
    assert says in result.seen
