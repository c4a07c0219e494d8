"""GPS and compass are what Habitat's sensors would say: metres forward and RIGHT, radians counter-clockwise."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.models.pirlnav.localisation import Localiser
from vsnbench.models.pirlnav.settings import PIRLNavSettings
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose, wrap_angle

STEP = Pose(0.25, 0.0)
LEFT, RIGHT = Pose(0, 0, math.pi / 2), Pose(0, 0, -math.pi / 2)

LEFT_SQUARE = [
    # driven, turned: where the robot is after a side of 25 cm and the corner after it
    ((0.25, 0.0), 90),
    ((0.25, -0.25), 180),
    ((0.0, -0.25), -90),
    ((0.0, 0.0), 0),
]
"""Round a square to the left: forward, left (negative right), back, home."""
RIGHT_SQUARE = [((0.25, 0.0), -90), ((0.25, 0.25), 180), ((0.0, 0.25), 90), ((0.0, 0.0), 0)]


def close_angle(a_rad: float, b_deg: float) -> bool:
    return abs(wrap_angle(a_rad - math.radians(b_deg))) < 1e-9


@pytest.mark.parametrize("start_deg", [0, 90, 180, 270])
@pytest.mark.parametrize(("corner", "expected"), [(LEFT, LEFT_SQUARE), (RIGHT, RIGHT_SQUARE)], ids=["left", "right"])
def test_a_square_gives_the_hand_computed_readings_from_every_heading(
    start_deg: int, corner: Pose, expected: list[tuple[tuple[float, float], int]]
) -> None:
    start = Pose.from_degrees(3.0, -2.0, start_deg)
    localiser = Localiser(PIRLNavSettings())
    localiser.reset()
    first = localiser.read(start.relative_to(start))
    assert first[0] == pytest.approx((0, 0))
    assert first[1] == 0
    robot = start
    for gps, compass_deg in expected:
        robot = robot.compose(STEP).compose(corner)
        reading = localiser.read(robot.relative_to(start))
        assert reading[0] == pytest.approx(gps, abs=1e-9)
        assert close_angle(reading[1], compass_deg)


@pytest.mark.parametrize(
    ("turn", "compass_deg"), [(Action.TURN_LEFT, [30, 60, 90]), (Action.TURN_RIGHT, [-30, -60, -90])]
)
def test_each_turn_direction_moves_the_compass_its_own_way(turn: Action, compass_deg: list[int]) -> None:
    by_odometry = Localiser(PIRLNavSettings())
    by_turns = Localiser(PIRLNavSettings(compass="turns"))
    sign = 1 if turn is Action.TURN_LEFT else -1
    for count, expected in enumerate(compass_deg, start=1):
        by_turns.moved(turn)
        assert close_angle(by_odometry.read(Pose.from_degrees(0, 0, sign * 30 * count))[1], expected)
        assert close_angle(by_turns.read(Pose(0, 0))[1], expected)


def test_counted_turns_do_not_look_at_odometry_and_start_anew_with_the_episode() -> None:
    localiser = Localiser(PIRLNavSettings(compass="turns", turn_deg=45))
    localiser.moved(Action.TURN_LEFT)
    localiser.moved(Action.MOVE_FORWARD)
    assert close_angle(localiser.read(Pose.from_degrees(1, 1, 170))[1], 45)
    localiser.reset()
    assert localiser.read(Pose.from_degrees(1, 1, 170))[1] == 0


def test_as_published_the_second_number_is_metres_left() -> None:
    localiser = Localiser(PIRLNavSettings(as_published=True))
    localiser.reset()
    assert localiser.read(Pose(1.0, 0.5, 0.25))[0] == (1.0, 0.5)


def test_as_published_odometry_goes_on_from_one_episode_to_the_next() -> None:
    localiser = Localiser(PIRLNavSettings(as_published=True))
    localiser.reset()
    localiser.read(Pose.from_degrees(2.0, 1.0, 90))
    localiser.reset()
    reading = localiser.read(Pose.from_degrees(0.5, 0.0, 30))
    assert reading[0] == pytest.approx((2.0, 1.5))
    assert close_angle(reading[1], 120)


def test_by_default_every_episode_starts_at_zero() -> None:
    localiser = Localiser(PIRLNavSettings())
    localiser.read(Pose.from_degrees(2.0, 1.0, 90))
    localiser.reset()
    assert localiser.read(Pose(0, 0))[0] == (0.0, 0.0)


@settings(deadline=None)
@given(x=st.floats(-50, 50), y=st.floats(-50, 50), heading=st.floats(-20, 20))
def test_the_compass_is_the_heading_in_half_turns(x: float, y: float, heading: float) -> None:
    reading = Localiser(PIRLNavSettings()).read(Pose(x, y, heading))
    assert -math.pi < reading[1] <= math.pi
    assert reading[0] == (x, -y)
    assert math.cos(reading[1]) == pytest.approx(math.cos(heading), abs=1e-9)
