"""A robot with a faulty depth camera has no collisions, for each fault, driving straight in simulation."""

import pytest

from tests.robots.blind_camera import FaultyRobot, ForwardOnly, drive
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import load_site

APARTMENT = load_site("apartment")
PROFILE = load_profile("turtlebot2")
SMALL = PROFILE.model_copy(update={"camera": PROFILE.camera.resized(160, 120)})

STARTS = (1, 2, 3)
"""The first of the three starts is in front of a wall: a frozen image of it refuses every move, and what is nearer than
the minimum range there was never seen by a camera with another one."""


@pytest.fixture(scope="module")
def robot() -> FaultyRobot:
    return FaultyRobot(APARTMENT, SMALL)


@pytest.mark.parametrize(
    ("fault", "moves", "ends"),
    [
        ("right", range(10, 60), {"step_limit": 3}),
        ("holes", range(10, 60), {"step_limit": 3}),
        ("minimum range", range(10, 60), {"step_limit": 2, "sensor_lost": 1}),
        ("nan", range(1), {"sensor_lost": 3}),
        ("frozen", range(1, 4), {"sensor_lost": 2, "step_limit": 1}),
        ("frozen colour", range(1, 4), {"sensor_lost": 2, "step_limit": 1}),
        ("millimetres", range(1), {"sensor_lost": 3}),
    ],
)
def test_a_faulty_camera_drives_into_nothing(robot: FaultyRobot, fault: str, moves: range, ends: dict) -> None:
    robot.fault = fault
    counts = drive(robot, APARTMENT, STARTS, 25)
    assert counts.collisions == 0
    assert counts.moves in moves
    assert counts.ends == ends


def test_a_camera_with_holes_refuses_the_same_moves_as_a_good_one(robot: FaultyRobot) -> None:
    counts = []
    for robot.fault in ("right", "holes"):
        counts.append(drive(robot, APARTMENT, STARTS, 25))
    right, holes = counts
    assert right.refused == holes.refused
    assert set(right.refused) == {"obstacle"}


def test_a_camera_without_half_of_its_depth_is_lost_once_the_robot_has_turned(robot: FaultyRobot) -> None:
    """A robot that never turns may be in front of a glass door."""
    robot.fault = "left half"
    assert drive(robot, APARTMENT, STARTS, 25).ends == {"step_limit": 3}
    turning = drive(robot, APARTMENT, STARTS, 25, policy=ForwardOnly(turns=True))
    assert turning.ends == {"sensor_lost": 3}
    assert turning.collisions == 0
    assert turning.words.startswith("the left half of the depth image is always invalid")
    robot.fault = "right"
    assert drive(robot, APARTMENT, STARTS, 60, policy=ForwardOnly(turns=True)).ends == {"step_limit": 3}
