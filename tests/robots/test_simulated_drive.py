"""The simulated robot executes movements with parameters, and stops for visible obstacles."""

import math

import pytest

from tests.movements import FORWARD, movement_of
from tests.sensing.stand import LEGGED
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import DrivingView
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.path_guard import MAX_AGE_S, PathGuard
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.movement import Action, Drive, Sidestep, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import BaseDynamics

ROOM = Site.model_validate(
    {
        "name": "room",
        "rooms": [{"name": "room", "polygon": [[-3, -3], [3, -3], [3, 3], [-3, 3]]}],
        "walls": [
            {"start": start, "end": end}
            for start, end in [([-3, -3], [3, -3]), ([3, -3], [3, 3]), ([3, 3], [-3, 3]), ([-3, 3], [-3, -3])]
        ],
        "starts": [{"number": 1, "position": [0, 0], "heading_deg": 0}],
    }
)


def robot_at(x_m: float, speed_m_s: float = 0.3) -> SimulatedRobot:
    profile = load_profile("turtlebot2")
    speeds = profile.speeds.model_copy(update={"linear_m_s": speed_m_s})
    robot = SimulatedRobot(ROOM, profile.model_copy(update={"speeds": speeds}))
    robot.begin(StartingPosition(number=1, position=(x_m, 0.0), heading_deg=0.0), 1)
    return robot


def guard_of(robot: SimulatedRobot) -> PathGuard:
    return PathGuard(robot.profile, ProtocolParameters())


@pytest.mark.parametrize(
    ("movement", "target"),
    [
        (Waypoint(1.2, 0.8), Pose(1.2, 0.8)),
        (Waypoint(-1.0, 0.5, math.pi / 2), Pose(-1.0, 0.5)),
        (Trajectory(((0.4, 0.0), (0.8, 0.2), (1.0, 0.6))), Pose(1.0, 0.6)),
    ],
)
def test_a_free_movement_ends_at_its_target(movement: Drive, target: Pose) -> None:
    robot = robot_at(0.0)
    result = robot.drive(movement, guard_of(robot))
    assert (result.completed, result.blocked, result.failure) == (True, "", "")
    assert robot.locate().pose.distance_to(target) < 0.02
    assert result.path_m is not None
    assert result.path_m >= math.hypot(target.x_m, target.y_m) - 0.03


def test_a_sidestep_ends_beside_the_start_and_at_a_wall_in_a_collision() -> None:
    robot = SimulatedRobot(ROOM, LEGGED)
    robot.begin(StartingPosition(number=1, position=(0.0, 2.0), heading_deg=0.0), 1)
    result = robot.drive(Sidestep(0.25), guard_of(robot))
    assert (result.completed, result.displacement_m) == (True, pytest.approx(0.25, abs=0.005))
    assert robot.locate().pose.distance_to(Pose(0.0, 2.25)) < 0.005
    result = robot.drive(Sidestep(1.0), guard_of(robot))
    assert result.collision is not None
    assert result.collision.touched == "wall"
    assert robot.locate().pose.y_m < 3.0 - LEGGED.base.radius_m


def test_a_velocity_to_the_side_is_driven_on_legs_and_refused_on_wheels() -> None:
    robot = SimulatedRobot(ROOM, LEGGED)
    robot.begin(StartingPosition(number=1, position=(0.0, 0.0), heading_deg=0.0), 1)
    result = robot.drive(Velocity(0.0, 0.0, 2.0, 0.2), guard_of(robot))
    assert (result.completed, result.failure) == (True, "")
    pose = robot.locate().pose
    assert (pose.x_m, 0.2 < pose.y_m < 0.4) == (pytest.approx(0.0, abs=0.01), True)
    on_wheels = robot_at(0.0)
    result = on_wheels.drive(Velocity(0.1, 0.0, 1.0, 0.2), guard_of(on_wheels))
    assert "max_lateral_m_s" in result.failure
    assert on_wheels.locate().pose.distance_to(Pose(0.0, 0.0)) < 0.01


@pytest.mark.parametrize("speed_m_s", [0.2, 0.3, 0.5])
@pytest.mark.parametrize("movement", [Waypoint(4.0, 0.0), Trajectory(((2.0, 0.0), (4.0, 0.1)))])
def test_a_wall_ahead_stops_a_movement_before_it_is_touched(movement: Drive, speed_m_s: float) -> None:
    robot = robot_at(0.0, speed_m_s)
    result = robot.drive(movement, guard_of(robot))
    assert result.blocked
    assert not result.completed
    assert result.collision is None
    left_m = 2.95 - robot.locate().pose.x_m - robot.profile.base.radius_m
    assert 0.1 < left_m < 0.7
    assert result.displacement_m > 1.0, "it drove until the wall was near"


def test_velocities_towards_a_wall_are_blocked_and_touch_nothing() -> None:
    robot = robot_at(1.0, 0.5)
    results = [robot.drive(Velocity(0.5, 0.0, 2.0), guard_of(robot)) for _ in range(4)]
    assert not any(result.collision for result in results)
    assert results[-1].blocked
    assert results[-1].displacement_m < 0.05


def test_a_turn_on_the_spot_needs_no_free_way() -> None:
    robot = robot_at(2.5)
    result = robot.drive(Waypoint(-1.0, 0.0), guard_of(robot))
    assert result.completed


def test_an_old_depth_image_stops_the_robot() -> None:
    robot = robot_at(0.0)
    guard, depth_m = guard_of(robot), robot.observe().depth_m
    assert depth_m is not None

    def view(age_s: float) -> DrivingView:
        return DrivingView(depth_m, robot.profile.camera, robot.locate().pose, 0.0, age_s, 0.3, 0.0, 1.0)

    assert guard(view(0.1)) == ""
    assert guard(view(MAX_AGE_S + 0.01)) != ""


LATE = BaseDynamics(
    dead_time_s=0.05, motor_time_constant_s=0.08, position_noise_m=0.001, heading_noise_deg=0.03, crab=0.01
)


def late_robot(x_m: float, seed: int = 1) -> SimulatedRobot:
    robot = SimulatedRobot(ROOM, load_profile("turtlebot2").model_copy(update={"dynamics": LATE}))
    robot.begin(StartingPosition(number=1, position=(x_m, 0.0), heading_deg=0.0), seed)
    return robot


def test_a_profile_with_dynamics_moves_accurately_by_the_mover_of_real_robots() -> None:
    robot = late_robot(0.0)
    assert robot.conditions["base"] == LATE.conditions
    for action, moved_m, turned_deg in [
        (Action.MOVE_FORWARD, 0.25, 0.0),
        (Action.TURN_LEFT, 0.0, 30.0),
        (Action.MOVE_BACKWARD, 0.25, 0.0),
    ]:
        before = robot.locate().pose
        result = robot.drive(movement_of(action))
        assert (result.completed, result.failure) == (True, "")
        after = robot.locate().pose
        assert before.distance_to(after) == pytest.approx(moved_m, abs=0.005)
        assert math.degrees(after.heading_rad - before.heading_rad) == pytest.approx(turned_deg, abs=0.5)
    start = robot.locate().pose
    result = robot.drive(Waypoint(1.0, 0.5), guard_of(robot))
    assert result.completed, result.failure
    assert robot.locate().pose.distance_to(start.compose(Pose(1.0, 0.5))) < 0.02
    assert result.path_m == pytest.approx(math.hypot(1.0, 0.5), abs=0.05)


def test_a_late_robot_stops_before_a_wall_and_the_same_seed_is_the_same_episode() -> None:
    ends = []
    for seed in (4, 4, 5):
        robot = late_robot(1.2, seed)
        result = robot.drive(Waypoint(3.0, 0.0), guard_of(robot))
        assert result.blocked
        assert (result.failure, result.collision) == ("", None)
        ends.append((robot.locate().pose, result.pose))
    assert ends[0] == ends[1]
    assert ends[0] != ends[2]


def test_a_late_robot_that_touches_a_wall_reports_the_collision() -> None:
    robot = late_robot(2.65)
    result = robot.drive(FORWARD)
    assert result.collision is not None
    assert result.collision.touched == "wall"
    assert not result.completed
