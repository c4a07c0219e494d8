"""The simulated robot: motion within tolerance, correct sensors, reproducible episodes."""

import hashlib
import math
import random
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from shapely.geometry import Point

from tests.movements import BACKWARD, FORWARD, LEFT, RIGHT
from tests.simulator.places import square_room, turtlebot2
from vsnbench.control.legs import longest_duration_s
from vsnbench.errors import RobotError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.sites.site import Site, SiteObject
from vsnbench.values.fix import PoseSource
from vsnbench.values.motion_result import CollisionSource, MotionResult
from vsnbench.values.movement import STOP, Move
from vsnbench.values.observation import Sensor
from vsnbench.values.pose import Pose, wrap_angle
from vsnbench.values.robot_profile import RobotProfile

MOTIONS = [FORWARD, BACKWARD, LEFT, RIGHT]
CHAIR = SiteObject(id="chair-1", category="chair", position=(3.0, 2.0), heading_deg=180, size_m=(0.5, 0.5, 0.9))
PLANT = SiteObject(id="plant-1", category="plant", position=(1.0, 3.2), size_m=(0.5, 0.5, 1.1))
FURNISHED = square_room(4.0, CHAIR, PLANT)


def robot_in(site: Site, profile: RobotProfile | None = None, noise: NoiseSettings | None = None) -> SimulatedRobot:
    """Return a robot with a small image."""
    wanted = profile if profile is not None else turtlebot2()
    return SimulatedRobot(
        site, wanted.model_copy(update={"camera": wanted.camera.resized(80, 60)}), ProtocolParameters(), noise
    )


def begun(robot: SimulatedRobot, seed: int = 0) -> SimulatedRobot:
    robot.begin(robot.site.starts[0], seed)
    return robot


@dataclass(frozen=True)
class Step:
    """A movement with odometry and true pose before and after it."""

    movement: Move
    result: MotionResult
    believed: tuple[Pose, Pose]
    true: tuple[Pose, Pose]


def drive(robot: SimulatedRobot, movements: list[Move]) -> list[Step]:
    steps = []
    believed, true = Pose(0.0, 0.0), robot.locate().pose
    for movement in movements:
        result = robot.drive(movement)
        assert result.pose is not None
        steps.append(Step(movement, result, (believed, result.pose), (true, robot.locate().pose)))
        believed, true = result.pose, robot.locate().pose
    return steps


def random_movements(number: int, seed: int = 1) -> list[Move]:
    rng = random.Random(seed)
    return [rng.choice(MOTIONS) for _ in range(number)]


@pytest.fixture(scope="module")
def furnished() -> SimulatedRobot:
    return robot_in(FURNISHED)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(("turtlebot2", 150), id="turtlebot2"),
        *(pytest.param((name, 500), id=f"{name} for long", marks=pytest.mark.long) for name in ("turtlebot2", "lola2")),
    ],
)
def hike(request: pytest.FixtureRequest) -> tuple[SimulatedRobot, list[Step]]:
    """Random actions in the open, by each of the embedded robots."""
    name, number = request.param
    robot = begun(robot_in(square_room(40.0, start=(20.0, 20.0), heading_deg=17.0), load_profile(name)))
    return robot, drive(robot, random_movements(number))


def worst(errors: list[float]) -> float:
    return max(abs(error) for error in errors)


Hike = tuple[SimulatedRobot, list[Step]]


@pytest.mark.parametrize("witness", ["believed", "true"])
def test_of_many_actions_every_move_is_within_5_mm(hike: Hike, witness: str) -> None:
    moves = [getattr(step, witness) for step in hike[1] if step.movement.distance_m]
    assert worst([before.distance_to(after) - 0.25 for before, after in moves]) < 0.005


@pytest.mark.parametrize("witness", ["believed", "true"])
def test_of_many_actions_every_turn_is_within_a_tenth_of_a_degree(hike: Hike, witness: str) -> None:
    turns = [(step.movement.turn_rad, getattr(step, witness)) for step in hike[1] if step.movement.turn_rad]
    errors = [
        math.degrees(wrap_angle(after.heading_rad - before.heading_rad - asked_rad))
        for asked_rad, (before, after) in turns
    ]
    assert worst(errors) < 0.1


@pytest.mark.parametrize("witness", ["believed", "true"])
def test_over_many_actions_the_heading_does_not_drift(hike: Hike, witness: str) -> None:
    target = 0.0
    for step in hike[1]:
        target += step.movement.turn_rad
        start_rad = math.radians(17.0) if witness == "true" else 0.0
        error_rad = wrap_angle(getattr(step, witness)[1].heading_rad - start_rad - target)
        assert abs(math.degrees(error_rad)) < 0.1


def test_over_many_actions_odometry_and_truth_stay_together(hike: Hike) -> None:
    start = hike[1][0].true[0]
    believed, true = hike[1][-1].believed[1], hike[1][-1].true[1]
    assert start.compose(believed).distance_to(true) < 0.02


def test_of_many_actions_none_takes_a_quarter_longer_than_the_ideal_profile(hike: Hike) -> None:
    robot, steps = hike
    ideal_s = [longest_duration_s(step.movement, robot.settings) - robot.settings.timeout_s for step in steps]
    ratios = [step.result.duration_s / shortest_s for step, shortest_s in zip(steps, ideal_s, strict=True)]
    assert min(ratios) >= 1.0
    assert max(ratios) < 1.25


def test_of_many_actions_all_are_reported_as_completed_with_what_was_measured(hike: Hike) -> None:
    for step in hike[1]:
        result = step.result
        assert result.completed
        assert (result.collision, result.failure) == (None, "")
        assert result.displacement_m == pytest.approx(step.movement.distance_m, abs=0.005)
        assert result.turn_rad == pytest.approx(step.movement.turn_rad, abs=math.radians(0.1))


def test_depth_beyond_the_cameras_range_is_told_from_depth_that_is_missing() -> None:
    whole = robot_in(FURNISHED)
    short = whole.profile.model_copy(update={"camera": whole.profile.camera.model_copy(update={"depth_max_m": 1.5})})
    far, seen = begun(whole).observe(), begun(SimulatedRobot(FURNISHED, short, ProtocolParameters())).observe()
    assert far.depth_m is not None
    assert seen.depth_m is not None
    assert seen.beyond_range is not None
    assert np.array_equal(seen.beyond_range, far.depth_m > 1.5)
    assert seen.beyond_range.any()
    assert np.isnan(seen.depth_m[seen.beyond_range]).all()


def test_it_is_a_robot(furnished: SimulatedRobot) -> None:
    assert isinstance(furnished, Robot)
    assert furnished.identity.simulated
    assert furnished.identity.site_sha256 == furnished.site.sha256


def test_what_nobody_looks_at_is_not_drawn_and_changes_nothing_else() -> None:
    whole = begun(robot_in(FURNISHED))
    lean = begun(SimulatedRobot(FURNISHED, whole.profile, ProtocolParameters(), read=frozenset({Sensor.ODOMETRY})))
    for movement in random_movements(12):
        drawn, measured = whole.observe(), lean.observe()
        assert Sensor.RGB in drawn.sensors
        assert measured.sensors == {Sensor.DEPTH, Sensor.ODOMETRY}
        assert np.array_equal(drawn.depth_m, measured.depth_m, equal_nan=True)
        assert (drawn.pose, drawn.stamp_s) == (measured.pose, measured.stamp_s)
        assert whole.drive(movement) == lean.drive(movement)


def test_a_wall_ends_a_move_and_is_named(furnished: SimulatedRobot) -> None:
    robot = begun(furnished)
    results = [robot.drive(movement) for movement in [LEFT] * 3 + [FORWARD] * 8]
    assert all(result.completed for result in results[:-1])
    last = results[-1]
    assert last.collision is not None
    assert (last.collision.source, last.collision.touched) == (CollisionSource.CONTACT, "wall")
    assert not last.completed
    assert "wall" in last.failure
    gap_m = 4.0 - 0.05 - robot.profile.base.radius_m - robot.locate().pose.y_m
    assert abs(gap_m) < 0.004


def test_a_chair_ends_a_move_and_is_named(furnished: SimulatedRobot) -> None:
    robot = begun(furnished)
    results = [robot.drive(FORWARD) for _ in range(3)]
    assert [result.collision is not None for result in results] == [False, False, True]
    assert results[-1].collision is not None
    assert results[-1].collision.touched == "chair-1"
    assert 0.0 < results[-1].displacement_m < 0.25
    assert results[-1].duration_s > 0
    gap_m = CHAIR.shape.distance(Point(robot.locate().pose.position)) - robot.profile.base.radius_m
    assert -0.05 < gap_m < 0.05


def test_turning_beside_a_thing_touches_nothing(furnished: SimulatedRobot) -> None:
    robot = begun(furnished)
    assert robot.drive(FORWARD).completed
    assert all(robot.drive(LEFT).completed for _ in range(12))


def test_a_start_inside_furniture_is_refused_by_name() -> None:
    robot = robot_in(square_room(4.0, CHAIR, start=(3.0, 1.9)))
    with pytest.raises(RobotError, match=r"starting position 1 .* touches chair-1"):
        begun(robot)


def test_nothing_can_be_done_before_an_episode_begins_or_after_closing() -> None:
    robot = robot_in(FURNISHED)
    for attempt in (robot.observe, robot.locate, lambda: robot.drive(STOP)):
        with pytest.raises(RobotError, match="begin an episode"):
            attempt()
    robot.halt()
    with robot:
        begun(robot)
        assert robot.drive(STOP).completed
    robot.halt()
    with pytest.raises(RobotError, match="begin an episode"):
        robot.observe()


def test_stop_moves_nothing_and_takes_no_time(furnished: SimulatedRobot) -> None:
    robot = begun(furnished)
    before = robot.locate()
    result = robot.drive(STOP)
    assert result.completed
    assert (result.displacement_m, result.turn_rad, result.duration_s) == (0.0, 0.0, 0.0)
    assert robot.locate() == before


def test_odometry_starts_at_zero_in_every_episode_and_is_relative_to_the_start(furnished: SimulatedRobot) -> None:
    robot = begun(furnished)
    robot.drive(LEFT)
    begun(robot)
    assert robot.observe().pose == Pose(0.0, 0.0, 0.0)
    assert robot.observe().stamp_s == 0.0
    robot.drive(RIGHT)
    robot.drive(FORWARD)
    seen = robot.observe()
    assert seen.pose.position == pytest.approx(
        (0.25 * math.cos(math.radians(30)), -0.25 * math.sin(math.radians(30))), abs=0.003
    )
    assert robot.locate().source is PoseSource.SIMULATED
    assert robot.site.starts[0].pose.compose(seen.pose).distance_to(robot.locate().pose) < 0.001


def test_time_passes_by_motion_only(furnished: SimulatedRobot) -> None:
    robot = begun(furnished)
    assert robot.observe().stamp_s == robot.observe().stamp_s == 0.0
    result = robot.drive(LEFT)
    assert robot.observe().stamp_s == pytest.approx(result.duration_s)


def test_depth_outside_the_cameras_range_is_invalid(furnished: SimulatedRobot) -> None:
    camera = furnished.profile.camera
    robot = begun(furnished)
    robot.drive(FORWARD)
    depth_m = robot.observe().depth_m
    assert depth_m is not None
    assert depth_m.shape == (camera.height, camera.width)
    valid = depth_m[np.isfinite(depth_m)]
    assert len(valid) > 0.5 * depth_m.size
    assert camera.depth_min_m <= valid.min() < valid.max() <= camera.depth_max_m
    near = camera.model_copy(update={"depth_min_m": 1.5})
    short = begun(SimulatedRobot(FURNISHED, robot.profile.model_copy(update={"camera": near})))
    short.drive(FORWARD)
    cut = short.observe().depth_m
    assert cut is not None
    np.testing.assert_array_equal(cut, np.where(depth_m >= 1.5, depth_m, np.nan))


def test_the_robot_sees_the_chair_ahead_and_knows_its_instance(furnished: SimulatedRobot) -> None:
    robot = begun(furnished)
    seen = robot.observe()
    assert seen.instances is not None
    assert seen.depth_m is not None
    assert seen.instances.categories == {1: "chair", 2: "plant"}
    chair = seen.instances.ids == 1
    assert chair.sum() > 30
    assert 2 not in seen.instances.ids
    assert float(np.nanmedian(seen.depth_m[chair])) == pytest.approx(1.0, abs=0.35)
    assert seen.camera == robot.profile.camera


def fingerprint(robot: SimulatedRobot, seed: int) -> str:
    """Return a hash of all measurements and images of an episode of 12 actions."""
    begun(robot, seed)
    digest = hashlib.sha256()
    for movement in random_movements(12, seed=5):
        result = robot.drive(movement)
        seen = robot.observe()
        assert seen.depth_m is not None
        for part in (seen.rgb, seen.depth_m, repr((result, robot.locate(), seen.pose, seen.stamp_s)).encode()):
            digest.update(bytes(part))
    return digest.hexdigest()


def test_the_same_seed_gives_the_same_episode_whatever_came_before() -> None:
    noisy = robot_in(FURNISHED, noise=NoiseSettings())
    first = fingerprint(noisy, seed=3)
    assert fingerprint(noisy, seed=4) != first
    assert fingerprint(noisy, seed=3) == first
    assert fingerprint(robot_in(FURNISHED, noise=NoiseSettings()), seed=3) == first


def test_without_noise_the_seed_does_not_matter(furnished: SimulatedRobot) -> None:
    assert fingerprint(furnished, seed=3) == fingerprint(furnished, seed=4)


def test_another_process_measures_and_sees_the_same(furnished: SimulatedRobot) -> None:
    program = (
        "from tests.robots.test_simulated import FURNISHED, fingerprint, robot_in\n"
        "print(fingerprint(robot_in(FURNISHED), 3))"
    )
    other = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120)
    assert other.stdout.strip() == fingerprint(furnished, seed=3)


def test_noise_makes_odometry_drift_and_depth_lose_pixels(furnished: SimulatedRobot) -> None:
    noisy = robot_in(FURNISHED, noise=NoiseSettings())
    plan = [FORWARD, *[LEFT] * 6, FORWARD, FORWARD]
    clean_robot, noisy_robot = begun(furnished), begun(noisy)
    drive(clean_robot, plan)
    steps = drive(noisy_robot, plan)
    believed, true = steps[-1].believed[1], steps[-1].true[1]
    assert FURNISHED.starts[0].pose.compose(believed).distance_to(true) > 0.002
    assert all(step.result.completed for step in steps)
    begun(clean_robot), begun(noisy_robot)
    clean, rough = clean_robot.observe().depth_m, noisy_robot.observe().depth_m
    assert clean is not None
    assert rough is not None
    assert np.isnan(rough).sum() > np.isnan(clean).sum()
    both = np.isfinite(clean) & np.isfinite(rough)
    assert 0.001 < float(np.std((clean - rough)[both])) < 0.05
    assert set(furnished.conditions) == {"simulator"}
    assert set(noisy.conditions["noise"]) == {"odometry", "depth"}
