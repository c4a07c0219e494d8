"""The simulated robot drives on along paths that replace each other, and stops for obstacles and at the end."""

import math

import pytest

from tests.robots.test_simulated_drive import LATE, ROOM, guard_of
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.sites.site import StartingPosition
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Drive, Trajectory, Velocity, Waypoint
from vsnbench.values.observation import Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import IDEAL_BASE, BaseDynamics

ANSWER_S = 0.3


def robot_at(
    x_m: float, heading_deg: float = 0.0, speed_m_s: float = 0.3, dynamics: BaseDynamics = IDEAL_BASE
) -> SimulatedRobot:
    profile = load_profile("turtlebot2")
    speeds = profile.speeds.model_copy(update={"linear_m_s": speed_m_s})
    camera = profile.camera.model_copy(update={"width": 160, "height": 120})
    profile = profile.model_copy(
        update={"speeds": speeds, "camera": camera, "dynamics": None if dynamics is IDEAL_BASE else dynamics}
    )
    robot = SimulatedRobot(ROOM, profile, read=frozenset({Sensor.DEPTH}))
    robot.begin(StartingPosition(number=1, position=(x_m, 0.0), heading_deg=heading_deg), 1)
    return robot


def drive_on(robot: SimulatedRobot, answer: Drive, seconds: float) -> list[MotionResult]:
    """Give the same answer again and again, until the robot is blocked or touches something."""
    results, now_s = [], robot.observe().stamp_s
    for _ in range(round(seconds / ANSWER_S)):
        robot.follow(answer, robot.observe().pose)
        now_s += ANSWER_S
        results.append(robot.advance(now_s, guard_of(robot)))
        if results[-1].blocked or results[-1].collision:
            break
    return results


@pytest.mark.parametrize("speed_m_s", [0.2, 0.3, 0.5])
@pytest.mark.parametrize("answer", [Waypoint(2.0, 0.0), Trajectory(((1.0, 0.0), (2.0, 0.1)))])
def test_new_paths_towards_a_wall_are_blocked_before_it_is_touched(answer: Drive, speed_m_s: float) -> None:
    robot = robot_at(1.0, speed_m_s=speed_m_s)
    results = drive_on(robot, answer, 15.0)
    assert results[-1].blocked
    assert not any(result.collision for result in results)
    rest = robot.come_to_rest()
    assert rest.collision is None
    left_m = 2.95 - robot.locate().pose.x_m - robot.profile.base.radius_m
    assert 0.1 < left_m < 0.7
    again = drive_on(robot, answer, 3.0)
    assert again[-1].blocked
    assert sum(result.displacement_m for result in again) < 0.05, "the next path towards the wall is refused at rest"


def test_velocities_towards_a_wall_are_blocked_before_it_is_touched() -> None:
    robot = robot_at(1.0, speed_m_s=0.5)
    results = drive_on(robot, Velocity(0.5, 0.0, 1.0), 15.0)
    assert results[-1].blocked
    assert robot.come_to_rest().collision is None


def test_a_base_with_delays_stops_before_a_wall_too() -> None:
    robot = robot_at(1.5, dynamics=LATE)
    results = drive_on(robot, Waypoint(2.0, 0.0), 15.0)
    assert results[-1].blocked
    assert robot.come_to_rest().collision is None
    assert robot.locate().pose.x_m < 2.95 - robot.profile.base.radius_m - 0.05


def test_the_robot_waits_at_the_end_of_its_path() -> None:
    robot = robot_at(-1.0)
    robot.follow(Waypoint(0.3, 0.0))
    result = robot.advance(4.0, guard_of(robot))
    assert result.completed
    assert result.displacement_m == pytest.approx(0.3, abs=0.02)
    assert result.waiting_s == pytest.approx(4.0 - 0.3 / 0.3 - 0.3 / 0.54, abs=0.3)


def test_braking_ends_at_rest_within_the_deceleration_of_the_base() -> None:
    robot = robot_at(-2.0)
    robot.follow(Waypoint(4.0, 0.0))
    robot.advance(2.0)
    rest = robot.come_to_rest()
    assert rest.displacement_m == pytest.approx(0.3**2 / (2 * 0.54), abs=0.02)
    end = robot.locate().pose
    robot.advance(robot.observe().stamp_s + 0.5)
    assert robot.locate().pose.distance_to(end) < 0.002


def test_a_contact_ends_the_motion_without_a_guard() -> None:
    robot = robot_at(2.2)
    robot.follow(Waypoint(3.0, 0.0))
    result = robot.advance(5.0)
    assert result.collision is not None
    assert not result.completed
    assert result.duration_s < 4.0


def test_a_glancing_contact_while_braking_is_a_collision() -> None:
    robot = robot_at(2.7, heading_deg=50.0, speed_m_s=0.5)
    robot.follow(Waypoint(3.0, 0.0))
    contact = robot.advance(5.0)
    assert contact.collision is not None
    robot = robot_at(2.7, heading_deg=50.0, speed_m_s=0.5)
    robot.follow(Waypoint(3.0, 0.0))
    assert robot.advance(contact.duration_s - 0.3).collision is None
    assert robot.come_to_rest().collision is not None, "although it has left the wall at the end"


def test_an_answer_is_anchored_at_the_pose_of_its_image() -> None:
    robot = robot_at(-2.0)
    captured = robot.observe().pose
    robot.follow(Waypoint(3.0, 0.0))
    robot.advance(2.0)
    robot.follow(Waypoint(1.5, 0.5), captured)
    robot.advance(12.0)
    assert robot.locate().pose.relative_to(Pose(-2.0, 0.0)).position == pytest.approx((1.5, 0.5), abs=0.03)
    assert math.degrees(robot.locate().pose.heading_rad) > 10
