"""A robot behind a motion adapter: movements, sensors, and what stops it."""

import math
import threading
from pathlib import Path
from typing import Any

import pytest

from tests.robots.adapter.adapters import START, PlaneBase, by_velocity, driven, served, write_profile
from vsnbench.errors import NotPlacedError, RobotError, SensorLostError
from vsnbench.robots.adapter.robot import AdapterRobot
from vsnbench.robots.contract import DrivingView
from vsnbench.robots.profiles import load_profile
from vsnbench.values.fix import PoseSource
from vsnbench.values.motion_result import CollisionSource
from vsnbench.values.movement import DRIVE_KINDS, STOP, ActionKind, Move, Trajectory, Velocity, Waypoint
from vsnbench.values.observation import Sensor
from vsnbench.values.pose import Pose


@pytest.fixture
def base() -> PlaneBase:
    return PlaneBase()


@pytest.mark.parametrize(
    ("movement", "end"),
    [
        (Move(0.25, holds_heading=True), (0.25, 0.0, 0.0)),
        (Move(-0.25, holds_heading=True), (-0.25, 0.0, 0.0)),
        (Move(turn_rad=math.radians(30), holds_heading=True), (0.0, 0.0, 30.0)),
        (Move(0.5, -1.5), (0.5 * math.cos(1.5), -0.5 * math.sin(1.5), math.degrees(-1.5))),
        (Move(turn_rad=-math.tau), (0.0, 0.0, -360.0)),
        (Waypoint(0.4, 0.3, math.pi / 2), (0.4, 0.3, 90.0)),
        (Trajectory(((0.3, 0.0), (0.3, 0.4))), (0.3, 0.4, 90.0)),
        (Velocity(0.2, 0.0, 1.0), (0.2, 0.0, 0.0)),
        (STOP, (0.0, 0.0, 0.0)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_movements_are_executed_and_measured(
    base: PlaneBase, tmp_path: Path, movement: Any, end: tuple[float, float, float]
) -> None:
    with driven(base, tmp_path) as robot:
        result = robot.drive(movement)
        fix = robot.locate()
    assert result.completed, result
    assert result.pose is not None
    assert (result.pose.x_m, result.pose.y_m) == pytest.approx(end[:2], abs=0.012)
    assert math.degrees(result.pose.heading_rad) == pytest.approx(end[2], abs=1.0)
    assert fix.source is PoseSource.ESTIMATED
    assert fix.pose.distance_to(START.pose.compose(Pose(*end[:2]))) < 0.012
    assert base.speed == (0.0, 0.0)


def test_the_card_says_what_the_robot_has(base: PlaneBase, tmp_path: Path) -> None:
    with driven(base, tmp_path) as robot:
        assert robot.action_kinds == DRIVE_KINDS | {ActionKind.DISCRETE}
        assert robot.sensors == {Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY}
        assert robot.conditions["adapter"] == {"name": "plane", "version": ""}
        assert robot.needs_operator
        assert robot.identity.kind == "adapter"
        observation = robot.observe()
    assert observation.rgb.shape == (48, 64, 3)
    assert observation.depth_m is not None
    assert float(observation.depth_m[0, 0]) == 3.0


def test_the_address_is_not_part_of_the_profiles_hash(tmp_path: Path) -> None:
    one = load_profile(write_profile(tmp_path, "ws://127.0.0.1:1")).sha256
    assert load_profile(write_profile(tmp_path, "ws://robot:2")).sha256 == one


def test_a_guard_stops_the_robot_on_its_way(base: PlaneBase, tmp_path: Path) -> None:
    seen: list[DrivingView] = []

    def watch(view: DrivingView) -> str:
        seen.append(view)
        return "a wall" if view.remaining_m < 0.6 else ""

    with driven(base, tmp_path) as robot:
        result = robot.drive(Waypoint(1.0, 0.0), watch)
    assert (result.completed, result.blocked, result.failure) == (False, "a wall", "")
    assert 0.3 < result.displacement_m < 0.6
    assert 0.1 < seen[-1].linear_m_s <= 0.31
    assert base.speed == (0.0, 0.0)


def test_a_movement_without_depth_is_blocked(base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with driven(base, tmp_path) as robot:
        seeing = base.state
        monkeypatch.setattr(base, "state", lambda **_: seeing())
        result = robot.drive(Waypoint(1.0, 0.0), lambda _: "")
    assert result.blocked == "no depth image"
    assert result.displacement_m == 0.0


@pytest.mark.parametrize(
    ("word", "check"),
    [
        ("collision", lambda result: result.collision.source is CollisionSource.BUMPER),
        ("blocked", lambda result: result.blocked and not result.failure),
        ("sensor", lambda result: result.sensor_lost and result.failure),
        ("fault", lambda result: result.failure == "the base reports: fault"),
    ],
)
def test_words_of_an_adapter_say_why_it_stopped(base: PlaneBase, tmp_path: Path, word: str, check: Any) -> None:
    with driven(base, tmp_path) as robot:
        base.word = word
        result = robot.drive(Move(0.25, holds_heading=True))
    assert not result.completed
    assert check(result), result


def test_a_movement_that_takes_too_long_ends_at_its_deadline(base: PlaneBase, tmp_path: Path) -> None:
    with driven(base, tmp_path) as robot:
        base.slips = 0.0
        result = robot.drive(Move(0.25, holds_heading=True))
    assert result.failure.startswith("not done after")


def test_a_base_that_turns_on_is_stopped(base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PlaneBase, "near_rad", -1.0)
    monkeypatch.setattr(by_velocity, "_limited", lambda *_: 0.5)
    with driven(base, tmp_path) as robot:
        result = robot.drive(Move(turn_rad=0.5, holds_heading=True))
    assert "the adapter was stopped: the robot has turned" in result.failure
    assert result.turn_rad < 0.8


@pytest.mark.parametrize("hazard", ["bumper", "cliff", "wheel drop"])
def test_no_episode_begins_with_an_active_hazard(base: PlaneBase, tmp_path: Path, hazard: str) -> None:
    base.reported = {"hazards": [hazard]}
    with pytest.raises(NotPlacedError, match=hazard), driven(base, tmp_path):
        raise AssertionError


def test_no_episode_begins_while_another_program_drives(base: PlaneBase, tmp_path: Path) -> None:
    base.reported = {"rival": "teleop"}
    with pytest.raises(RobotError, match="teleop is driving") as refused, driven(base, tmp_path):
        raise AssertionError
    assert refused.value.code == "base-is-driven"


def test_another_program_ends_the_movement(base: PlaneBase, tmp_path: Path) -> None:
    with driven(base, tmp_path) as robot:
        base.reported = {"rival": "teleop"}
        result = robot.drive(Waypoint(1.0, 0.0))
    assert result.failure == "teleop is driving the robot too: end that program"
    assert abs(result.displacement_m) < 0.01


def test_odometry_that_jumps_is_a_lost_sensor(base: PlaneBase, tmp_path: Path) -> None:
    with driven(base, tmp_path) as robot:
        base.at = Pose(50.0, 0.0)
        with pytest.raises(SensorLostError, match="odometry jumped"):
            robot.drive(Move(0.25, holds_heading=True))


def test_old_images_are_refused(base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsnbench.robots.adapter.robot._NEW_IMAGES_S", 0.0)
    with driven(base, tmp_path) as robot:
        assert robot.drive(Move(0.25, holds_heading=True)).completed
        base.time_s -= 0.5
        with pytest.raises(SensorLostError, match=r"0\.50 s older") as old:
            robot.observe()
    assert old.value.code == "old-images"


def test_images_of_another_size_are_refused(base: PlaneBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = {"encoding": "raw", "height": 10, "width": 10, "data": bytes(300)}
    monkeypatch.setattr(base, "colours", lambda: image)
    with driven(base, tmp_path) as robot, pytest.raises(SensorLostError, match="10x10, the profile has 64x48"):
        robot.observe()


def test_halt_from_another_thread_ends_a_movement(base: PlaneBase, tmp_path: Path) -> None:
    with driven(base, tmp_path) as robot:

        def watch(view: DrivingView) -> str:
            if view.remaining_m < 0.7:
                halting = threading.Thread(target=robot.halt)
                halting.start()
                halting.join()
            return ""

        result = robot.drive(Waypoint(1.0, 0.0), watch)
    assert (result.completed, result.failure) == (False, "the client is gone, or asked to stop")
    assert 0.2 < result.displacement_m < 0.6


def test_a_request_to_stop_stops_the_robot_first(base: PlaneBase, tmp_path: Path) -> None:
    def watch(view: DrivingView) -> str:
        if view.remaining_m < 0.7:
            raise KeyboardInterrupt
        return ""

    with driven(base, tmp_path) as robot:
        with pytest.raises(KeyboardInterrupt):
            robot.drive(Waypoint(1.0, 0.0), watch)
        robot.halt()
        motion = robot.interrupted_motion()
    assert motion is not None
    assert 0.2 < motion.displacement_m < 0.6
    assert base.speed == (0.0, 0.0)


def test_one_robot_has_one_client(base: PlaneBase, tmp_path: Path) -> None:
    with served(base) as address:
        profile = load_profile(write_profile(tmp_path, address))
        with AdapterRobot(profile), pytest.raises(RobotError) as refused:
            AdapterRobot(profile)
    assert refused.value.code == "robot-in-use"
