"""Paths replace each other without a stop, within the accelerations of the base."""

import itertools
import math
from collections.abc import Callable

import pytest

from vsnbench.control.command import Command
from vsnbench.control.law import acceleration
from vsnbench.control.paths.path_follower import PathFollower
from vsnbench.control.settings import MotionSettings
from vsnbench.values.movement import Drive, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose, advanced

SETTINGS = MotionSettings()
PERIOD_S = SETTINGS.control_period_s
LINEAR_M_S2 = acceleration(SETTINGS.linear_m_s, SETTINGS.forward_m, SETTINGS.acceleration_share)
ANGULAR_RAD_S2 = acceleration(SETTINGS.angular_rad_s, SETTINGS.turn_rad, SETTINGS.acceleration_share)


class Drives:
    """An exact base that follows paths on a counted clock."""

    def __init__(self, settings: MotionSettings = SETTINGS) -> None:
        self.follower = PathFollower(settings)
        self.pose, self.now_s = Pose(0.0, 0.0), 0.0
        self.commands: list[Command] = []
        self.poses = [self.pose]

    def drive(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            command = self.follower.step(self.pose, self.now_s, self.now_s)
            self.pose = advanced(self.pose, command.linear_m_s * PERIOD_S, command.angular_rad_s * PERIOD_S)
            self.now_s += PERIOD_S
            self.commands.append(command)
            self.poses.append(self.pose)

    def follow(self, movement: Drive, origin: Pose | None = None) -> None:
        self.follower.follow(movement, origin or self.pose, self.pose)

    def check_accelerations(self) -> None:
        before = Command()
        for command in self.commands:
            assert abs(command.linear_m_s - before.linear_m_s) <= LINEAR_M_S2 * PERIOD_S + 1e-9
            assert abs(command.angular_rad_s - before.angular_rad_s) <= ANGULAR_RAD_S2 * PERIOD_S + 1e-9
            before = command


WAVE_M, AMPLITUDE_M = 2.4, 0.3


def wave(x_m: float) -> tuple[float, float]:
    return x_m, AMPLITUDE_M * (1 - math.cos(math.tau * x_m / WAVE_M))


def next_of_the_wave(pose: Pose, length_m: float) -> Trajectory:
    """Return the next part of the wave, in the frame of a pose near it."""
    points = (Pose(*wave(pose.x_m + 0.05 * k)).relative_to(pose) for k in range(1, round(length_m / 0.05) + 1))
    return Trajectory(tuple(point.position for point in points))


def from_the_wave_m(pose: Pose) -> float:
    return min(math.dist(pose.position, wave(pose.x_m + 0.01 * k)) for k in range(-30, 31))


@pytest.mark.parametrize(
    "answer",
    [
        lambda pose: Waypoint(*Pose(3.0, 0.4).relative_to(pose).position),
        lambda pose: Trajectory(tuple(Pose(pose.x_m + x, 0.0).relative_to(pose).position for x in (0.5, 1.0, 1.5))),
        lambda _pose: Velocity(0.3, 0.0, 1.0),
    ],
)
def test_new_paths_every_300_ms_do_not_slow_the_robot_down(answer: Callable[[Pose], Drive]) -> None:
    robot = Drives()
    for _ in range(15):
        robot.follow(answer(robot.pose))
        robot.drive(0.3)
    cruising = robot.commands[round(1.5 / PERIOD_S) :]
    assert min(command.linear_m_s for command in cruising) > 0.29
    robot.check_accelerations()


def test_a_velocity_to_the_side_begins_and_ends_within_the_acceleration_of_the_base() -> None:
    follower = PathFollower(MotionSettings(lateral_m_s=0.2))
    here = Pose(0.0, 0.0)
    follower.follow(Velocity(0.1, 0.0, 1.0, 0.15), here, here)
    commands = []
    for k in range(100):
        commands.append(follower.step(here, k * PERIOD_S, k * PERIOD_S))
        here = here.compose(Pose(commands[-1].linear_m_s * PERIOD_S, commands[-1].lateral_m_s * PERIOD_S))
    assert max(command.lateral_m_s for command in commands) == pytest.approx(0.15)
    assert commands[-1] == Command()
    steps = [abs(b.lateral_m_s - a.lateral_m_s) for a, b in itertools.pairwise(commands)]
    assert max(steps) < 0.3 * PERIOD_S
    assert (follower.failure, follower.waits) == ("", True)


def test_a_path_in_another_direction_takes_over_within_the_accelerations() -> None:
    robot = Drives()
    robot.follow(Trajectory(((1.0, 0.0), (2.0, 0.0))))
    robot.drive(2.0)
    robot.follow(Trajectory(((0.3, 0.1), (0.5, 0.5), (0.5, 1.5))))
    robot.drive(11.0)
    robot.check_accelerations()
    assert robot.follower.waits
    assert robot.pose.position == pytest.approx((1.02, 1.5), abs=0.03)


def test_a_path_ends_at_its_end_and_the_robot_waits_there() -> None:
    robot = Drives()
    robot.follow(Waypoint(0.8, 0.5, math.pi / 2))
    robot.drive(9.0)
    assert robot.pose.position == pytest.approx((0.8, 0.5), abs=0.03)
    assert robot.pose.heading_rad == pytest.approx(math.pi / 2, abs=math.radians(2))
    assert robot.follower.waits
    assert robot.commands[-1] == Command()
    robot.check_accelerations()


def test_a_point_behind_the_robot_is_reached_after_a_turn_on_the_spot() -> None:
    robot = Drives()
    robot.follow(Waypoint(-1.0, 0.0))
    robot.drive(14.0)
    assert robot.pose.position == pytest.approx((-1.0, 0.0), abs=0.03)


@pytest.mark.parametrize(("anchored", "holds"), [(True, True), (False, False)])
def test_answers_that_are_a_second_late_stay_on_the_curve_only_if_they_are_anchored(
    anchored: bool, holds: bool
) -> None:
    robot = Drives()
    robot.follow(next_of_the_wave(robot.pose, 1.5))
    robot.drive(1.0)
    for _ in range(8):
        captured = robot.pose
        answer = next_of_the_wave(captured, 1.5)
        robot.drive(1.0)  # the model thinks
        robot.follow(answer, captured if anchored else None)
    assert (max(map(from_the_wave_m, robot.poses)) < 0.03) is holds


def test_braking_takes_as_long_as_the_deceleration_needs() -> None:
    robot = Drives()
    robot.follow(Waypoint(3.0, 0.0))
    robot.drive(2.0)
    robot.follower.brake()
    robot.drive(1.0)
    assert robot.follower.waits
    robot.check_accelerations()


@pytest.mark.parametrize(
    ("answer", "end"),
    [
        (Waypoint(0.8, 0.5, math.pi / 2), (0.8, 0.5)),
        (Trajectory(((0.5, 0.1), (1.0, 0.4), (1.2, 1.0))), (1.2, 1.0)),
        (Velocity(0.05, 0.1, 1.0), (0.0, 0.0)),
    ],
)
def test_no_command_is_slower_than_the_base_can_move(answer: Drive, end: tuple[float, float]) -> None:
    robot = Drives(SETTINGS.model_copy(update={"slowest_m_s": 0.12, "slowest_rad_s": 0.25}))
    robot.follow(answer)
    robot.drive(9.0)
    assert all(abs(command.linear_m_s) >= 0.12 or command.linear_m_s == 0.0 for command in robot.commands)
    assert all(abs(command.angular_rad_s) >= 0.25 or command.angular_rad_s == 0.0 for command in robot.commands)
    assert robot.follower.waits
    assert robot.pose.position == pytest.approx(end, abs=0.03)


def test_a_base_that_does_not_move_is_reported() -> None:
    follower = PathFollower(SETTINGS)
    follower.follow(Waypoint(1.0, 0.0), Pose(0.0, 0.0), Pose(0.0, 0.0))
    for k in range(150):
        follower.step(Pose(0.0, 0.0), k * PERIOD_S, k * PERIOD_S)
    assert "does not follow" in follower.failure
    assert follower.command == Command()
