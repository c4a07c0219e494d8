import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.movements import movement_of
from tests.runner.stand_ins import StandInRobot
from vsnbench.protocol.disturbances import KINDS, SEVERITIES, parse_disturbances
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.disturbances.policy_view import PolicyView
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.sites.site import load_site
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

SITE = load_site("apartment")
PROFILE = load_profile("turtlebot2")
SMALL = PROFILE.model_copy(update={"camera": PROFILE.camera.resized(160, 120)})


@pytest.fixture(scope="module")
def robot() -> SimulatedRobot:
    made = SimulatedRobot(SITE, SMALL, ProtocolParameters())
    made.begin(SITE.start(3), 5)
    return made


def view(robot: Any, text: str, seed: int = 5) -> PolicyView:
    return PolicyView(parse_disturbances([text] if text else []), robot, seed)


def sensed(observation: Observation, sensor: Sensor) -> bytes:
    match sensor:
        case Sensor.RGB:
            return observation.rgb.tobytes()
        case Sensor.DEPTH:
            assert observation.depth_m is not None
            return observation.depth_m.tobytes()
        case Sensor.INSTANCES:
            assert observation.instances is not None
            return observation.instances.ids.tobytes()
        case Sensor.ODOMETRY:
            return repr(observation.pose).encode()


def walk(robot: SimulatedRobot, chosen: PolicyView) -> tuple[list[Observation], list[Observation]]:
    """Return the observations of the robot and the policy while the robot turns and drives."""
    robot.begin(SITE.start(3), 5)
    own, seen = [], []
    for action in (Action.TURN_LEFT, Action.TURN_LEFT, Action.MOVE_FORWARD, Action.TURN_RIGHT):
        own.append(robot.observe())
        seen.append(chosen.of(own[-1]))
        robot.drive(movement_of(action))
    return own, seen


def test_without_disturbances_the_policy_gets_the_robots_own_observation(robot: SimulatedRobot) -> None:
    own = robot.observe()
    assert view(robot, "").of(own) is own


@pytest.mark.parametrize("name", KINDS)
def test_a_disturbance_changes_its_own_sensors_only(robot: SimulatedRobot, name: str) -> None:
    plain, undisturbed = walk(robot, view(robot, ""))
    before = [sensed(observation, sensor) for observation in plain for sensor in Sensor]
    own, seen = walk(robot, view(robot, f"{name}@5"))
    assert before == [sensed(observation, sensor) for observation in own for sensor in Sensor], "the robot's own data"
    changed = {
        sensor
        for sensor in Sensor
        if [sensed(observation, sensor) for observation in seen]
        != [sensed(observation, sensor) for observation in undisturbed]
    }
    assert changed == KINDS[name].sensors


@pytest.mark.parametrize("name", [name for name in KINDS if name != "latency"])
def test_equal_seeds_give_equal_views(robot: SimulatedRobot, name: str) -> None:
    views = [walk(robot, view(robot, f"{name}@4", seed))[1] for seed in (1, 1, 2)]
    first, again, other = ([sensed(seen, sensor) for seen in each for sensor in Sensor] for each in views)
    assert first == again
    random = name in {"glare", "low_light", "depth_holes", "dropped_frames", "odometry_drift"}
    assert (first != other) is random


def test_a_disturbance_acts_alike_alone_and_with_others(robot: SimulatedRobot) -> None:
    alone = walk(robot, view(robot, "depth_holes@3"))[1]
    together = walk(robot, view(robot, "depth_holes@3,low_light@2,odometry_drift@5"))[1]
    for one, both in zip(alone, together, strict=True):
        assert sensed(one, Sensor.DEPTH) == sensed(both, Sensor.DEPTH)


def test_blur_keeps_the_light_and_smooths_more_with_severity(robot: SimulatedRobot) -> None:
    own = robot.observe()
    steps = [float(np.abs(np.diff(own.rgb.astype(float), axis=1)).mean())]
    for severity in SEVERITIES:
        rgb = view(robot, f"blur@{severity}").of(own).rgb.astype(float)
        assert abs(rgb.mean() - own.rgb.mean()) < 2
        steps.append(float(np.abs(np.diff(rgb, axis=1)).mean()))
    assert steps == sorted(steps, reverse=True)


def test_blur_is_the_same_angle_at_every_resolution() -> None:
    def spread(width: int) -> float:
        rgb = np.zeros((64, width, 3), np.uint8)
        rgb[:, width // 2] = 255
        image = Observation(rgb, None, Pose(0, 0), 0.0, SMALL.camera)
        row = view(StandInRobot(), "blur=10").of(image).rgb[32, :, 0].astype(float)
        return float(np.sqrt((row * (np.arange(width) - width // 2) ** 2).sum() / row.sum())) / width

    assert spread(640) == pytest.approx(10 / 640, rel=0.1)
    assert spread(1280) == pytest.approx(10 / 640, rel=0.1)


def test_low_light_darkens_by_its_share_and_adds_noise(robot: SimulatedRobot) -> None:
    grey = np.full((120, 160, 3), 128, np.uint8)
    image = Observation(grey, None, Pose(0, 0), 0.0, SMALL.camera)
    rgb = view(robot, "low_light=0.85").of(image).rgb.astype(float)
    light = (rgb / 255) ** 2.2
    assert light.mean() == pytest.approx(0.15 * (128 / 255) ** 2.2, rel=0.05)
    assert rgb.std() > 1


def test_the_glare_comes_from_one_direction_of_the_site() -> None:
    grey = np.full((120, 160, 3), 100, np.uint8)
    chosen = view(StandInRobot(), "glare=1", seed=11)
    brightness = []
    for degrees in range(0, 360, 30):
        image = Observation(grey, None, Pose.from_degrees(0, 0, degrees), 0.0, SMALL.camera)
        brightness.append(float(chosen.of(image).rgb.mean()))
    assert max(brightness) > 150
    assert min(brightness) == 100
    brightest = brightness.index(max(brightness))
    assert brightness[brightest - 6] == 100, "the opposite direction has none"


@pytest.mark.parametrize("share", [0.2, 0.6])
def test_depth_holes_cover_their_share(robot: SimulatedRobot, share: float) -> None:
    own = robot.observe()
    chosen, lost = view(robot, f"depth_holes={share}"), []
    for _ in range(40):
        depth_m = chosen.of(own).depth_m
        assert own.depth_m is not None
        assert depth_m is not None
        kept = np.isfinite(depth_m)
        assert np.array_equal(depth_m[kept], own.depth_m[kept])
        lost.append(1 - kept.sum() / np.isfinite(own.depth_m).sum())
    assert np.mean(lost) == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize("noise", [None, NoiseSettings()])
def test_a_moved_camera_sees_what_a_robot_with_that_camera_sees(noise: NoiseSettings | None) -> None:
    robot = SimulatedRobot(SITE, SMALL, ProtocolParameters(), noise)
    camera = SMALL.camera.model_copy(update={"mount_height_m": SMALL.camera.mount_height_m - 0.2, "tilt_deg": -10.0})
    other = SimulatedRobot(SITE, SMALL.model_copy(update={"camera": camera}), ProtocolParameters(), noise)
    for body in (robot, other):
        body.begin(SITE.start(3), 5)
    seen, expected = view(robot, "camera_height=-0.2,camera_tilt=-10").of(robot.observe()), other.observe()
    assert seen.camera.mount_height_m == pytest.approx(camera.mount_height_m)
    assert np.array_equal(seen.rgb, expected.rgb)
    if noise is None:
        assert np.array_equal(seen.depth_m, expected.depth_m, equal_nan=True)  # type: ignore[arg-type]


def test_a_second_view_does_not_change_the_robots_own_noise() -> None:
    robot = SimulatedRobot(SITE, SMALL, ProtocolParameters(), NoiseSettings())
    plain = [sensed(own, Sensor.DEPTH) for own in walk(robot, view(robot, ""))[0]]
    assert plain == [sensed(own, Sensor.DEPTH) for own in walk(robot, view(robot, "camera_tilt=5"))[0]]


def test_stale_frames_are_those_of_observations_before(robot: SimulatedRobot) -> None:
    own, seen = walk(robot, view(robot, "stale_frames=2"))
    assert [observation.stamp_s for observation in seen] == [own[at].stamp_s for at in (0, 0, 0, 1)]
    assert [observation.pose for observation in seen] == [own[at].pose for at in (0, 0, 0, 1)]


def test_dropped_frames_repeat_the_last_images_with_new_odometry(robot: SimulatedRobot) -> None:
    first = robot.observe()
    chosen, repeated = view(robot, "dropped_frames=0.4"), 0
    shown_s = -1.0
    for number in range(400):
        own = replace(first, stamp_s=float(number), pose=Pose(number * 0.01, 0.0))
        seen = chosen.of(own)
        assert seen.pose == own.pose
        assert number or seen.stamp_s == 0, "the first image is never lost"
        repeated += seen.stamp_s == shown_s
        assert seen.stamp_s in (shown_s, own.stamp_s)
        shown_s = seen.stamp_s
    assert repeated / 400 == pytest.approx(0.4, abs=0.08)


def test_odometry_drifts_by_its_share_from_a_true_start() -> None:
    ends = []
    for seed in range(300):
        chosen = view(StandInRobot(), "odometry_drift=0.05", seed)
        for turned in range(13):
            pose = Pose.from_degrees(0, 0, 30 * turned)
            wrapped = Pose(0, 0, math.remainder(pose.heading_rad, math.tau))
            seen = chosen.of(Observation(np.zeros((4, 4, 3), np.uint8), None, wrapped, 0.0, SMALL.camera))
            if not turned:
                assert seen.pose == Pose(0, 0)
        ends.append(seen.pose.heading_rad - math.tau)
    assert np.mean(ends) == pytest.approx(0, abs=0.06)
    assert np.std(ends) == pytest.approx(0.05 * math.tau, rel=0.15)


def test_a_robot_without_colours_still_has_disturbed_depth() -> None:
    blind = SimulatedRobot(SITE, SMALL, ProtocolParameters(), read=frozenset({Sensor.DEPTH}))
    blind.begin(SITE.start(3), 5)
    seen = view(blind, "blur,depth_holes,odometry_drift,dropped_frames,camera_tilt").of(blind.observe())
    assert seen.sensors == {Sensor.DEPTH, Sensor.ODOMETRY}
