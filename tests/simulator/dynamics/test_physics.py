"""The base in MuJoCo: it follows commands, feels what it touches, and does the same thing every time."""

import math

import pytest

from tests.simulator.places import GREY, pillar, scene_of, turtlebot2
from vsnbench.control.command import Command
from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.dynamics import physics as physics_module
from vsnbench.simulator.dynamics.odometry import WheelOdometry
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, Physics, Touch
from vsnbench.simulator.primitives import Primitive, Scene, Shape
from vsnbench.values.pose import Pose, wrap_angle

BASE = turtlebot2().base
SECOND = round(1 / CONTROL_PERIOD_S)


def base_in(scene: Scene) -> Physics:
    return Physics(scene, BASE)


def drive(physics: Physics, command: Command, periods: int) -> Touch | None:
    for _ in range(periods):
        if touch := physics.drive(command):
            return touch
    return None


@pytest.mark.parametrize("profile", ["turtlebot2", "lola2"])
def test_a_velocity_held_for_a_while_moves_the_base_that_far(profile: str) -> None:
    physics = Physics(scene_of(), load_profile(profile).base)
    physics.place(Pose(1.0, 2.0, math.pi / 2))
    drive(physics, Command(linear_m_s=0.3), 4 * SECOND)
    assert physics.pose.y_m == pytest.approx(3.2, abs=0.01)
    assert physics.pose.x_m == pytest.approx(1.0, abs=1e-4)
    physics.place(Pose(0.0, 0.0, 0.0))
    drive(physics, Command(angular_rad_s=0.5), 4 * SECOND)
    assert physics.pose.heading_rad == pytest.approx(2.0, abs=0.02)
    assert math.hypot(*physics.pose.position) < 1e-3


def test_a_base_without_wheels_moves_as_commanded() -> None:
    base = turtlebot2().base.model_copy(update={"track_m": None, "wheel_radius_m": None})
    physics = Physics(scene_of(), base)
    physics.place(Pose(0.0, 0.0, 0.0))
    drive(physics, Command(linear_m_s=0.3), 2 * SECOND)
    assert physics.pose.x_m == pytest.approx(0.6, abs=0.01)
    physics.place(Pose(0.0, 0.0, 0.0))
    drive(physics, Command(angular_rad_s=0.5), 2 * SECOND)
    assert physics.pose.heading_rad == pytest.approx(1.0, abs=0.02)


def test_an_arc_bends_to_the_left_of_a_positive_turn() -> None:
    physics = base_in(scene_of())
    physics.place(Pose(0.0, 0.0, 0.0))
    drive(physics, Command(0.2, 0.4), 2 * SECOND)
    radius_m = 0.5
    assert physics.pose.x_m == pytest.approx(radius_m * math.sin(0.8), abs=0.01)
    assert physics.pose.y_m == pytest.approx(radius_m * (1 - math.cos(0.8)), abs=0.01)


def test_commands_beyond_the_bases_limits_are_cut_to_them() -> None:
    physics = base_in(scene_of())
    physics.place(Pose(0.0, 0.0, 0.0))
    drive(physics, Command(linear_m_s=100.0), 2 * SECOND)
    assert physics.pose.x_m <= BASE.max_linear_m_s * 2


def test_time_passes_only_while_driving_and_starts_again_when_placed() -> None:
    physics = base_in(scene_of())
    physics.place(Pose(0.0, 0.0))
    drive(physics, Command(), 5)
    assert physics.time_s == pytest.approx(0.1)
    physics.place(Pose(0.0, 0.0))
    assert physics.time_s == 0.0
    assert (physics.wheel_angles.left_rad, physics.wheel_angles.right_rad) == (0.0, 0.0)


def test_a_base_put_down_stands_still() -> None:
    physics = base_in(scene_of())
    physics.place(Pose(3.0, 4.0, 1.0))
    drive(physics, Command(), 2 * SECOND)
    assert physics.pose.distance_to(Pose(3.0, 4.0)) < 1e-5
    assert physics.pose.heading_rad == pytest.approx(1.0, abs=1e-6)


def test_the_shell_feels_a_pillar_when_it_gets_there() -> None:
    physics = base_in(scene_of(pillar(1.0, 0.0)))
    physics.place(Pose(0.0, 0.0, 0.0))
    touch = drive(physics, Command(linear_m_s=0.3), 10 * SECOND)
    assert touch is not None
    assert (touch.instance, touch.category) == (1, "cabinet")
    assert touch.bearing_rad == pytest.approx(0.0, abs=0.7)
    gap_m = 0.9 - BASE.radius_m - physics.pose.x_m
    assert -0.002 < gap_m < 0.0005
    physics.stop()
    assert physics.pose.x_m + BASE.radius_m < 0.9 + 0.003


@pytest.mark.parametrize(("side", "expected_deg"), [(0.15, 60.0), (-0.15, -60.0)])
def test_a_touch_says_on_which_side_it_was(side: float, expected_deg: float) -> None:
    thin = Primitive(Shape.CYLINDER, (1.0, side, 0.5), (0.005, 0.005, 0.5), GREY, category="lamp", instance=2)
    physics = base_in(scene_of(pillar(5.0, 5.0), thin))
    physics.place(Pose(0.0, 0.0, 0.0))
    touch = drive(physics, Command(linear_m_s=0.3), 10 * SECOND)
    assert touch is not None
    assert touch.category == "lamp"
    assert math.degrees(touch.bearing_rad) == pytest.approx(expected_deg, abs=15)


def test_backing_off_ends_a_touch() -> None:
    physics = base_in(scene_of(pillar(1.0, 0.0)))
    physics.place(Pose(0.0, 0.0, 0.0))
    assert drive(physics, Command(linear_m_s=0.3), 10 * SECOND)
    physics.stop()
    for _ in range(SECOND):
        physics.drive(Command(linear_m_s=-0.1))
    assert physics.touch() is None
    assert physics.pose.x_m < 0.9 - BASE.radius_m - 0.05


@pytest.mark.parametrize(
    "untouchable",
    [
        pillar(1.0, 0.0, bottom_m=BASE.height_m + 0.02, top_m=2.0),
        Primitive(Shape.BOX, (1.0, 0.0, 0.5), (0.1, 0.1, 0.5), GREY, category="rug", instance=1, solid=False),
    ],
    ids=["a shelf higher than the robot", "a thing that is not solid"],
)
def test_objects_out_of_reach_are_not_touched(untouchable: Primitive) -> None:
    physics = base_in(scene_of(untouchable))
    physics.place(Pose(0.0, 0.0, 0.0))
    assert drive(physics, Command(linear_m_s=0.5), 4 * SECOND) is None
    assert physics.pose.x_m > 1.5


def test_a_base_put_down_inside_something_touches_it() -> None:
    physics = base_in(scene_of(pillar(1.0, 0.0)))
    physics.place(Pose(1.2, 0.0))
    assert physics.touch() is not None
    physics.place(Pose(2.0, 0.0))
    assert physics.touch() is None


@pytest.mark.parametrize("shape", list(Shape))
def test_every_shape_is_felt_even_tilted(shape: Shape) -> None:
    tilted = Primitive(
        shape, (1.0, 0.0, 0.3), (0.1, 0.1, 0.2), GREY, (math.cos(0.3), 0.0, math.sin(0.3), 0.0), "plant", 1
    )
    physics = base_in(scene_of(tilted))
    physics.place(Pose(0.0, 0.0, 0.0))
    touch = drive(physics, Command(linear_m_s=0.3), 10 * SECOND)
    assert touch is not None
    assert touch.category == "plant"


def test_wheels_that_turn_against_a_wall_slip_and_odometry_believes_them() -> None:
    physics = base_in(scene_of(pillar(0.6, 0.0, 0.2)))
    physics.place(Pose(0.0, 0.0, 0.0))
    odometry = WheelOdometry(physics.rolling_radius_m, physics.track_m)
    for _ in range(4 * SECOND):
        physics.drive(Command(linear_m_s=0.3))
        odometry.update(physics.wheel_angles)
    assert physics.pose.x_m < 0.25
    assert odometry.pose.x_m > physics.pose.x_m + 0.05


def test_skipping_far_solids_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same drive, once with solids only when they are near, once with all of them all the time."""
    pillars = [pillar(0.2 * k, 0.5 + 0.05 * k) for k in range(20)]

    def trace() -> list[Pose]:
        physics = base_in(scene_of(*pillars))
        physics.place(Pose(-1.0, 0.0, 0.0))
        poses = []
        for period in range(8 * SECOND):
            if physics.drive(Command(0.3, 0.2 * math.sin(period / 30))):
                break
            poses.append(physics.pose)
        return poses

    skipping = trace()
    monkeypatch.setattr(physics_module, "_NEAR_M", 1e6)
    always = trace()
    assert len(skipping) == len(always) > SECOND
    assert skipping == always


def test_the_same_drive_twice_is_the_same_to_the_last_bit() -> None:
    def trace(physics: Physics) -> list[Pose]:
        physics.place(Pose(0.3, -0.2, 0.7))
        poses = []
        for period in range(5 * SECOND):
            physics.drive(Command(0.3 * math.sin(period / 20), 0.5 * math.cos(period / 15)))
            poses.append(physics.pose)
        return poses

    one = base_in(scene_of(pillar(0.7, 0.4)))
    first = trace(one)
    assert trace(one) == first
    assert trace(base_in(scene_of(pillar(0.7, 0.4)))) == first


def test_mujoco_does_not_time_its_steps() -> None:
    physics = base_in(scene_of(pillar(0.7, 0.4)))
    physics.place(Pose(0.0, 0.0))
    drive(physics, Command(0.1, 0.0), SECOND)
    assert not physics._world.data.timer.duration.any()


def test_wheel_odometry_is_off_by_the_wheels_slip_only() -> None:
    physics = base_in(scene_of())
    start = Pose(1.0, -2.0, 2.5)
    physics.place(start)
    odometry = WheelOdometry(physics.rolling_radius_m, physics.track_m)
    for period in range(20 * SECOND):  # 6 m of snaking
        physics.drive(Command(0.3, 0.5 * math.sin(period / 60)))
        odometry.update(physics.wheel_angles)
    believed = start.compose(odometry.pose)
    assert believed.distance_to(physics.pose) < 0.02
    assert abs(wrap_angle(believed.heading_rad - physics.pose.heading_rad)) < math.radians(1)
