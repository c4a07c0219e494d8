"""Twenty movements of each robot that labs have, on a stand-in of its base, in virtual time.

`tests/ros/ros2/test_lab_robots.py` drives the same over a ROS 2 graph.
"""

import math

import pytest

from tests.robots.lab_robots import ROBOTS, disagreement, movements
from tests.sensing.stand import Stand


@pytest.mark.parametrize("name", ROBOTS)
def test_twenty_movements_are_done(name: str) -> None:
    robot = ROBOTS[name]
    stand = Stand(robot.dynamics, profile=robot.profile)
    failures = {}
    for movement in movements(robot.profile):
        true, odometry, began_s = stand.base.pose, stand.base.odometry, stand.base.now_s
        result = stand.drive(movement)
        off_m, off_rad = disagreement((true, stand.base.pose), (odometry, stand.base.odometry))
        if not result.completed or stand.base.now_s - began_s > 25 or off_m > 0.06 or math.degrees(off_rad) > 5:
            failures[movement] = result.failure, off_m, math.degrees(off_rad)
    assert failures == {}


def test_a_stretch_as_delivered_needs_the_limits_of_its_ramp() -> None:
    """With these limits in a copy of the profile, a driver that nobody has set up drives too (docs/lab-robots.md)."""
    profile = ROBOTS["stretch"].profile
    limits = {"max_acceleration_m_s2": 0.08, "max_acceleration_rad_s2": 0.25}
    limited = profile.model_copy(update={"base": profile.base.model_copy(update=limits)})
    as_delivered = ROBOTS["stretch"].dynamics.model_copy(update={"wheel_acceleration_m_s2": 0.12})
    stand = Stand(as_delivered, profile=limited)
    results = {movement: stand.drive(movement) for movement in movements(limited)[5:12]}
    assert {movement: result.failure for movement, result in results.items() if not result.completed} == {}
