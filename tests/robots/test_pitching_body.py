"""The depth guard knows how the body leans: it sees low obstacles, and takes no floor for one."""

import math

import numpy as np
import pytest

from tests.robots.pitching_body import GAIT, LANE_M, LANES, Approaches, approach, lanes, walker
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.depth_guard import GuardReading, Refusal, look_ahead
from vsnbench.sensing.images.rectifier import Rectifier
from vsnbench.simulator.rendering.mesh import build_mesh
from vsnbench.simulator.rendering.renderer import DepthDrawer, Pinhole, eye_of
from vsnbench.simulator.scene import build_scene
from vsnbench.values.observation import Sensor, observation_of
from vsnbench.values.pose import Attitude, Pose

HALL = lanes()
DRAWER = DepthDrawer(build_mesh(build_scene(HALL)))
GUARD = DepthGuard()


def reading(lane: str, ahead_m: float, attitude: Attitude, *, knows_attitude: bool) -> GuardReading:
    """Return the guard's reading in front of an obstacle, that far ahead of the front."""
    profile = walker(GAIT, knows_attitude=knows_attitude)
    camera, pose = profile.camera, Pose(2.9 - profile.base.radius_m - ahead_m, LANE_M * (LANES.index(lane) + 0.5))
    pinhole = Pinhole(camera.width, camera.height, camera.focal_px, *camera.center_px)
    depth_m = DRAWER.draw(eye_of(camera, pose, attitude), pinhole).depth_m.copy()
    depth_m[(depth_m < camera.depth_min_m) | (depth_m > camera.depth_max_m)] = np.nan
    if knows_attitude:
        depth_m, camera = Rectifier(camera, None, 0, attitude).depth(depth_m), camera.on(attitude)
    return look_ahead(observation_of(0.0, camera, depth_m=depth_m), profile.base, GUARD)


@pytest.mark.parametrize("roll_deg", [-3, 0, 3])
@pytest.mark.parametrize("pitch_deg", [-5, 0, 5])
@pytest.mark.parametrize("lane", [lane for lane in LANES if lane not in ("free", "leg")])
def test_an_obstacle_ahead_is_seen_at_every_attitude(lane: str, pitch_deg: float, roll_deg: float) -> None:
    attitude = Attitude(math.radians(roll_deg), math.radians(pitch_deg))
    assert reading(lane, 0.25, attitude, knows_attitude=True).refusal is Refusal.OBSTACLE


@pytest.mark.parametrize("roll_deg", [-3, 0, 3])
@pytest.mark.parametrize("pitch_deg", [-5, 0, 5])
def test_floor_is_no_obstacle_at_any_attitude(pitch_deg: float, roll_deg: float) -> None:
    attitude = Attitude(math.radians(roll_deg), math.radians(pitch_deg))
    assert not reading("free", 0.5, attitude, knows_attitude=True).blocked


def test_without_its_attitude_a_pitching_body_overlooks_a_kerb_and_stops_for_the_floor() -> None:
    up, down = Attitude(0.0, math.radians(-5)), Attitude(0.0, math.radians(5))
    assert reading("kerb", 0.25, up, knows_attitude=False).refusal is not Refusal.OBSTACLE
    assert reading("free", 0.5, down, knows_attitude=False).refusal is Refusal.OBSTACLE


def test_a_walking_robot_stops_before_a_kerb_and_its_images_state_the_tilt() -> None:
    profile = walker(GAIT, knows_attitude=True)
    robot = SimulatedRobot(HALL, profile, read=frozenset({Sensor.DEPTH, Sensor.ODOMETRY}))
    counts = Approaches()
    approach(robot, "kerb", np.random.default_rng(1), counts, drives_through=True)
    assert (counts.touched, len(counts.left_m)) == ([], 1)
    tilts_deg = {robot.observe().camera.tilt_deg}
    robot.begin(HALL.starts[0], 5)
    tilts_deg.add(robot.observe().camera.tilt_deg)
    assert len(tilts_deg) == 2
    assert all(abs(tilt_deg - profile.camera.tilt_deg) < 6 for tilt_deg in tilts_deg)
