"""Movements with parameters on a base that follows its commands exactly, late or sluggishly."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.control.command import STANDSTILL, MotionStatus
from vsnbench.control.leg import Leg
from vsnbench.control.legs import LegPlan, controller_of, longest_duration_s
from vsnbench.control.settings import MotionSettings
from vsnbench.values.movement import STOP, Drive, Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose, wrap_angle

SETTINGS = MotionSettings()
START = Pose(3.0, -2.0, 0.7)
PERIOD_S = 0.02
METRES, RADIANS = st.floats(-2.5, 2.5), st.floats(-math.tau, math.tau)


class ExactBase:
    """Follows commands after `lag` periods."""

    def __init__(self, lag: int = 0, stuck_s: float = math.inf) -> None:
        self.stuck_s = stuck_s
        """Time from which the base does not move."""
        self.pose = START
        self.now_s = 0.0
        self.path_m = 0.0
        self._waiting = [STANDSTILL] * lag

    def drive(self, movement: Drive) -> tuple[bool, str]:
        """Return whether the movement was completed, and the reason if not."""
        plan = LegPlan(movement, START)
        while (leg := plan.next(self.pose)) is not None:
            controller = controller_of(leg, self.pose, leg.end_rad(START.heading_rad), SETTINGS)
            while controller.status is MotionStatus.MOVING:
                self._waiting.append(controller.step(self.pose, self.now_s))
                command = self._waiting.pop(0) if self.now_s < self.stuck_s else STANDSTILL
                turn_rad = command.angular_rad_s * PERIOD_S
                way_m = command.linear_m_s * PERIOD_S
                middle_rad = self.pose.heading_rad + turn_rad / 2
                self.pose = Pose(
                    self.pose.x_m + way_m * math.cos(middle_rad),
                    self.pose.y_m + way_m * math.sin(middle_rad),
                    self.pose.heading_rad + turn_rad,
                )
                self.path_m += abs(way_m)
                self.now_s += PERIOD_S
            if not controller.done:
                return False, controller.failure
        return True, ""


@settings(max_examples=60)
@given(METRES, RADIANS, st.integers(0, 4))
def test_a_move_ends_at_its_turn_and_distance(distance_m: float, turn_rad: float, lag: int) -> None:
    base = ExactBase(lag)
    assert base.drive(Move(distance_m, turn_rad)) == (True, "")
    wanted = START.compose(Pose(distance_m * math.cos(turn_rad), distance_m * math.sin(turn_rad), turn_rad))
    assert wanted.distance_to(base.pose) < 0.02
    assert abs(wrap_angle(wanted.heading_rad - base.pose.heading_rad)) < math.radians(1)
    assert base.now_s < longest_duration_s(Move(distance_m, turn_rad), SETTINGS)


@settings(max_examples=60)
@given(METRES, METRES, st.none() | RADIANS, st.integers(0, 4))
def test_a_waypoint_is_reached_with_its_heading(x_m: float, y_m: float, heading_rad: float | None, lag: int) -> None:
    base = ExactBase(lag)
    assert base.drive(Waypoint(x_m, y_m, heading_rad)) == (True, "")
    assert START.compose(Pose(x_m, y_m)).distance_to(base.pose) < 0.02
    if heading_rad is not None:
        assert abs(wrap_angle(START.heading_rad + heading_rad - base.pose.heading_rad)) < math.radians(1)
    assert base.path_m < math.hypot(x_m, y_m) + 0.05


@pytest.mark.parametrize("stuck_s", [0.0, 0.4, 1.0, 1.3, 1.7])
@pytest.mark.parametrize(
    "movement",
    [
        Move(2.0, 0.0),
        Move(0.0, 1.5),
        Waypoint(2.0, 0.0),
        Waypoint(0.0, 2.0),
        Trajectory(((0.5, 0.0), (1.0, 0.2), (2.0, 0.4))),
        Trajectory(((0.0, 0.5), (0.0, 1.0))),
        Velocity(0.25, 0.2, 2.9),
        Velocity(0.0, 0.5, 2.9),
    ],
)
def test_a_base_that_gets_stuck_is_found_within_a_second(movement: Drive, stuck_s: float) -> None:
    base = ExactBase(2, stuck_s)
    completed, failure = base.drive(movement)
    assert not completed
    assert "does not follow" in failure
    assert base.now_s - stuck_s < 1.0


@settings(max_examples=40)
@given(st.lists(st.floats(-0.7, 0.7), min_size=2, max_size=12), st.integers(0, 4))
def test_a_trajectory_is_followed_to_its_end_without_cutting_its_length(turns_rad: list[float], lag: int) -> None:
    points, heading_rad, x_m, y_m = [], 0.0, 0.0, 0.0
    for turn_rad in turns_rad:
        heading_rad += turn_rad
        x_m, y_m = x_m + 0.25 * math.cos(heading_rad), y_m + 0.25 * math.sin(heading_rad)
        points.append((x_m, y_m))
    base = ExactBase(lag)
    assert base.drive(Trajectory(tuple(points))) == (True, "")
    assert START.compose(Pose(x_m, y_m)).distance_to(base.pose) < 0.02
    length_m = 0.25 * len(points)
    assert 0.7 * length_m < base.path_m < 1.2 * length_m + 0.1


@pytest.mark.parametrize(("linear_m_s", "angular_rad_s"), [(0.3, 0.0), (0.0, 0.5), (-0.2, 0.3), (0.0, 0.0)])
def test_a_velocity_ends_at_rest_after_its_duration(linear_m_s: float, angular_rad_s: float) -> None:
    base = ExactBase()
    assert base.drive(Velocity(linear_m_s, angular_rad_s, 1.5)) == (True, "")
    assert 1.5 <= base.now_s < 1.5 + 0.3
    assert base.path_m <= abs(linear_m_s) * 1.5
    assert base.path_m >= 0.5 * abs(linear_m_s) * 1.5


def test_a_waypoint_of_a_robot_with_wide_tolerances_is_not_turned_to_for_ever() -> None:
    wide = MotionSettings(position_tolerance_m=0.04, heading_tolerance_rad=math.radians(4))
    plan, at, legs = LegPlan(Waypoint(0.6, -0.3), START, wide), START, []
    while (leg := plan.next(at)) is not None and len(legs) < 20:
        legs.append(leg)
        if leg.turns:  # ends 0.5° before its end, and rolls on by nothing
            at = Pose(at.x_m, at.y_m, at.heading_rad + leg.way - math.copysign(math.radians(0.5), leg.way))
        else:
            at = Pose(*START.compose(Pose(0.59, -0.28)).position, at.heading_rad)
    assert [leg.turns for leg in legs] == [True, False]
    assert plan.failure == ""


def test_a_robot_that_turns_in_vain_drives_after_two_turns() -> None:
    plan = LegPlan(Waypoint(0.0, 1.0), START)
    legs = [plan.next(START) for _ in range(3)]
    assert [leg.turns for leg in legs if leg] == [True, True, False]


@pytest.mark.parametrize(
    "movement", [Waypoint(2.0, 1.0), Trajectory(((1.0, 0.0), (2.0, 0.5))), Velocity(0.3, 0.0, 2.0)]
)
def test_a_base_that_stands_still_is_reported(movement: Drive) -> None:
    plan = LegPlan(movement, START)
    leg = plan.next(START)
    assert leg is not None
    controller = controller_of(leg, START, leg.end_rad(START.heading_rad), SETTINGS)
    now_s = 0.0
    while controller.status is MotionStatus.MOVING and now_s < 20:
        controller.step(START, now_s)
        now_s += PERIOD_S
    assert controller.status is MotionStatus.FAILED
    assert controller.failure


@pytest.mark.parametrize(
    "movement", [Waypoint(2.0, 1.0), Trajectory(((1.0, 0.0), (2.0, 0.5))), Velocity(0.3, 0.0, 2.0)]
)
def test_silent_odometry_ends_a_movement_as_a_lost_sensor(movement: Drive) -> None:
    leg = LegPlan(movement, START).next(START)
    assert leg is not None
    controller = controller_of(leg, START, leg.end_rad(START.heading_rad), SETTINGS)
    now_s = 0.0
    while controller.status is MotionStatus.MOVING and now_s < 20:
        controller.step(START, now_s, stamp_s=0.0)
        now_s += PERIOD_S
    assert controller.sensor_lost
    assert now_s < SETTINGS.odometry_timeout_s + 0.1


def test_a_long_leg_accelerates_like_a_discrete_move() -> None:
    leg = LegPlan(Waypoint(4.0, 0.0), Pose(0.0, 0.0, 0.0)).next(Pose(0.0, 0.0, 0.0))
    assert isinstance(leg, Leg)
    long = leg.settings(SETTINGS)
    assert long.acceleration_share * long.forward_m == pytest.approx(SETTINGS.acceleration_share * SETTINGS.forward_m)


def test_a_point_that_is_missed_again_and_again_is_a_failure_with_its_distance() -> None:
    plan, beside, legs = LegPlan(Waypoint(1.0, 0.0), START), START.compose(Pose(0.95, 0.0)), 0
    while plan.next(beside) is not None:
        legs += 1
        assert legs < 20
    assert legs == 4
    assert "50 mm from the requested point" in plan.failure


def test_a_small_remainder_behind_the_robot_is_reversed_without_a_turn() -> None:
    plan = LegPlan(Trajectory(((0.5, 0.0), (1.0, 0.0))), START)
    assert plan.next(START).path
    leg = plan.next(START.compose(Pose(1.04, 0.002)))
    assert leg.backs_off
    assert leg.way == pytest.approx(-0.04, abs=0.001)
    assert plan.next(START.compose(Pose(1.0, 0.002))) is None
    assert plan.failure == ""


def test_a_point_behind_the_robot_is_first_faced() -> None:
    assert LegPlan(Waypoint(-0.1, 0.0), START).next(START).turns


def test_an_action_is_one_leg_relative_to_the_held_heading() -> None:
    held_rad = 0.3
    for _ in range(12):
        plan = LegPlan(Move(turn_rad=math.radians(30), holds_heading=True), START)
        leg = plan.next(START)
        held_rad = leg.end_rad(held_rad)
        assert plan.next(START) is None
    assert held_rad == pytest.approx(0.3 + math.tau, abs=1e-12)
    ahead = LegPlan(Move(0.25, holds_heading=True), START).next(START)
    assert (ahead.end_rad(held_rad), ahead.target, ahead.settings(SETTINGS)) == (held_rad, None, SETTINGS)
    assert LegPlan(STOP, START).next(START) is None
