"""A movement that leaves its request is detected while it runs, and an answer of True is checked afterwards."""

import math

import pytest

from tests.movements import BACKWARD, FORWARD, LEFT, RIGHT
from vsnbench.sensing.movement_check import contradiction, displacement_m, overshoot
from vsnbench.values.movement import STOP, Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

BEFORE = Pose.from_degrees(1.0, 2.0, 90.0)


def after(forward_m: float, turned_deg: float) -> Pose:
    return BEFORE.compose(Pose(forward_m, 0.0, math.radians(turned_deg)))


@pytest.mark.parametrize(
    ("movement", "forward_m", "turned_deg", "says"),
    [
        (FORWARD, 0.34, 0, ""),
        (FORWARD, 0.36, 0, "has moved 36.0 cm where 25 cm were requested"),
        (FORWARD, -0.11, 0, "has moved -11.0 cm"),
        (FORWARD, 0.1, 11, "has turned 11.0° where 0° were requested"),
        (BACKWARD, -0.34, 0, ""),
        (BACKWARD, -0.36, 0, "has moved -36.0 cm where -25 cm were requested"),
        (LEFT, 0, 39, ""),
        (LEFT, 0, 41, "has turned 41.0° where 30° were requested"),
        (LEFT, 0, -11, "has turned -11.0°"),
        (RIGHT, 0, -41, "has turned -41.0° where -30° were requested"),
        (RIGHT, 0.11, -10, "has moved 11.0 cm where 0 cm were requested"),
        (STOP, 0.0, 0.0, ""),
    ],
)
def test_a_movement_is_stopped_10_cm_or_10_degrees_past_its_request(movement, forward_m, turned_deg, says) -> None:
    seen = overshoot(movement, BEFORE, after(forward_m, turned_deg))
    assert says in seen
    assert bool(says) == bool(seen)


def test_an_answer_of_true_to_a_movement_that_fell_short_is_contradicted() -> None:
    assert contradiction(LEFT, BEFORE, after(0, 24)) == ""
    assert "turned 12.0° instead of 0 cm and 30°" in contradiction(LEFT, BEFORE, after(0, 12))


@pytest.mark.parametrize(
    ("movement", "end"), [(Waypoint(1.0, 0.5), Pose(1.0, 0.5)), (Trajectory(((0.5, 0.0), (1.0, 0.2))), Pose(1.0, 0.2))]
)
def test_a_point_missed_by_more_than_3_cm_contradicts_the_answer(movement, end) -> None:
    assert contradiction(movement, BEFORE, BEFORE.compose(Pose(end.x_m, end.y_m + 0.025))) == ""
    assert "4.0 cm from the requested position" in contradiction(
        movement, BEFORE, BEFORE.compose(Pose(end.x_m, end.y_m + 0.04))
    )


@pytest.mark.parametrize(
    ("movement", "end", "moved_m"),
    [
        (Waypoint(-1.6, 0.0), Pose(-1.6, 0.0, math.pi), 1.6),
        (Trajectory(((-0.3, 0.4), (-0.6, 0.8))), Pose(-0.6, 0.8, 2.2), 1.0),
        (Move(1.0, math.pi), Pose(-1.0, 0.0, math.pi), 1.0),
        (Move(-1.0, 0.0), Pose(-1.0, 0.0), -1.0),
        (Velocity(-0.2, 0.0, 1.0), Pose(-0.2, 0.0), -0.2),
        (BACKWARD, Pose(-0.25, 0.0), -0.25),
    ],
)
def test_only_a_robot_that_drove_backwards_has_a_negative_displacement(movement, end, moved_m) -> None:
    assert displacement_m(movement, BEFORE, BEFORE.compose(end)) == pytest.approx(moved_m)
