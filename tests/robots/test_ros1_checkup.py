"""How the doctor judges a turn: by what the odometry did, whatever was answered."""

import math

import pytest

from vsnbench.robots.ros1_checkup import judge_turn


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
