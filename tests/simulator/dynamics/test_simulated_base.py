"""The simulated base behaves as a real base's driver does: commands expire, odometry counts on, events come."""

import math

import pytest

from vsnbench.control.command import Command
from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S
from vsnbench.simulator.dynamics.simulated_base import SimulatedBase
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import parse_site
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import BaseDynamics

HALL = parse_site(
    """
name: hall
rooms: [{name: hall, polygon: [[-5, -5], [5, -5], [5, 5], [-5, 5]]}]
walls: [{start: [2, -5], end: [2, 5]}]
starts: [{number: 1, position: [0, 0], heading_deg: 0}]
""",
    origin="hall",
)
SCENE = build_scene(HALL)
PROFILE = load_profile("turtlebot2")


def base(**options) -> SimulatedBase:
    return SimulatedBase(HALL, SCENE, PROFILE, **options)


def drive(robot: SimulatedBase, command: Command, seconds: float) -> list:
    """Repeat a command for some seconds, and return what was touched."""
    touched = []
    for _ in range(round(seconds / CONTROL_PERIOD_S)):
        robot.set_command(command)
        touched.append(robot.advance())
    return touched


def test_a_command_expires_when_none_follows() -> None:
    robot = base()
    robot.set_command(Command(0.2, 0.0))
    for _ in range(100):
        robot.advance()
    assert robot.pose.x_m == pytest.approx(0.2 * 0.6, abs=0.02)
    assert robot.command == Command()


def test_a_lag_delays_every_command() -> None:
    late, prompt = base(dynamics=BaseDynamics(dead_time_s=0.1)), base()
    for robot in (late, prompt):
        drive(robot, Command(0.2, 0.0), 1.0)
    assert prompt.pose.x_m - late.pose.x_m == pytest.approx(0.02, abs=0.004)


def test_odometry_counts_on_when_the_robot_is_put_down_elsewhere() -> None:
    robot = base()
    drive(robot, Command(0.2, 0.5), 1.0)
    drive(robot, Command(), 0.5)
    before = robot.odometry
    assert robot.put_down(Pose(-2.0, 1.0, 1.2), seed=3) == ""
    assert robot.odometry.distance_to(before) < 1e-6
    assert robot.pose.position == pytest.approx((-2.0, 1.0))
    drive(robot, Command(0.2, 0.0), 1.0)
    assert robot.odometry.distance_to(before) == pytest.approx(0.2, abs=0.01)
    # It drives off in the direction that it faces in its own frame, wherever that is in the world.
    way = robot.odometry.relative_to(before)
    assert abs(math.atan2(way.y_m, way.x_m)) < 0.02


def test_resetting_odometry_zeroes_position_and_heading_some_time_after_it_was_asked() -> None:
    robot = base()
    drive(robot, Command(0.2, 0.5), 2.0)
    drive(robot, Command(), 1.0)
    before = robot.odometry
    assert abs(before.heading_rad) > 0.5
    robot.reset_odometry()
    robot.advance()
    assert robot.odometry.distance_to(before) < 1e-6
    robot.advance()
    assert robot.odometry.position == pytest.approx((0.0, 0.0), abs=1e-6)
    assert robot.odometry.heading_rad == pytest.approx(0.0, abs=1e-6)
    drive(robot, Command(0.2, 0.0), 1.0)
    assert robot.odometry.x_m == pytest.approx(0.2, abs=0.02)
    assert robot.odometry.y_m == pytest.approx(0.0, abs=0.002)


def test_a_wall_is_felt_by_the_centre_of_the_bumper() -> None:
    robot = base()
    robot.put_down(Pose(1.6, 0.0, 0.0), seed=0)
    contacts = [contact for contact in drive(robot, Command(0.3, 0.0), 2.0) if contact]
    assert contacts[0].name == "wall"
    assert contacts[0].bumper == 1


def test_a_wall_behind_is_touched_but_not_felt_by_the_bumper() -> None:
    robot = base()
    robot.put_down(Pose(1.6, 0.0, math.pi), seed=0)
    contacts = [contact for contact in drive(robot, Command(-0.3, 0.0), 2.0) if contact]
    assert contacts[0].bumper is None


def test_a_place_in_a_wall_is_refused_by_name() -> None:
    assert base().put_down(Pose(2.0, 0.0, 0.0), seed=0) == "wall"


def test_noise_follows_from_the_seed() -> None:
    ends = []
    for seed in (1, 1, 2):
        robot = base(noise=NoiseSettings())
        robot.put_down(Pose(-3.0, 0.0, 0.0), seed=seed)
        drive(robot, Command(0.3, 0.2), 2.0)
        ends.append(robot.odometry)
    assert ends[0] == ends[1]
    assert ends[0] != ends[2]
