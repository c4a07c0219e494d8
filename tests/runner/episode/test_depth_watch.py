"""A camera that is blind, frozen or measures in another unit ends the episode; a correct one never does."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.runner.stand_ins import PROFILE
from vsnbench.errors import SensorLostError
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.runner.episode.depth_guard import Refusal, look_ahead
from vsnbench.runner.episode.depth_watch import MAX_BLIND_REFUSALS, DepthWatch
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import SIMULATED, RobotIdentity

CAMERA = PROFILE.camera.model_copy(update={"depth_min_m": 0.4, "depth_max_m": 8.0})
GUARD = DepthGuard()
REAL = RobotIdentity(PROFILE, "ros1", simulated=False)
IN_SIMULATION = RobotIdentity(PROFILE, SIMULATED, simulated=True)
FORWARD = MotionResult(completed=True, displacement_m=0.25)
TURN = MotionResult(completed=True, turn_rad=0.52)


def seeing(depth: Any, digest: bytes | None = None) -> Observation:
    depth_m = np.asarray(np.broadcast_to(depth, (48, 64)), np.float32).copy()
    rgb = np.zeros((48, 64, 3), np.uint8)
    return Observation(rgb, depth_m, Pose(0, 0), 0.0, CAMERA, depth_frame_digest=digest)


def wall(distance_m: float, seed: int = 0) -> Observation:
    return seeing(distance_m + 0.001 * np.random.default_rng(seed).random((48, 64)))


def floor() -> Observation:
    rays = CAMERA.rays(64, 48)
    depth_m = np.where(rays.up < -0.08, -rays.height_m / np.minimum(rays.up, -0.01), np.nan)
    return seeing(depth_m[:, None])


BLIND = seeing(np.nan)


def push(watch: DepthWatch, seen: Observation) -> None:
    watch.look(seen)
    reading = look_ahead(seen, PROFILE.base, GUARD)
    watch.refused(reading)
    assert reading.refusal is Refusal.BLIND


def test_a_camera_that_stays_blind_is_lost_at_the_third_refusal() -> None:
    watch = DepthWatch(REAL, GUARD)
    watch.look(wall(3.0))
    for _ in range(MAX_BLIND_REFUSALS - 1):
        push(watch, BLIND)
    with pytest.raises(SensorLostError, match="stays blind: 3 forward moves were refused"):
        push(watch, BLIND)


def test_a_look_that_saw_the_path_resets_the_count() -> None:
    watch = DepthWatch(REAL, GUARD)
    for seed in range(4):
        push(watch, BLIND)
        push(watch, BLIND)
        watch.look(wall(3.0, seed))


def test_a_wall_below_the_minimum_range_is_not_a_lost_camera() -> None:
    watch = DepthWatch(REAL, GUARD)
    watch.look(wall(0.6))
    watch.moved(FORWARD)
    for _ in range(20):
        push(watch, BLIND)
    for _ in range(5):
        watch.moved(TURN)
        push(watch, BLIND)
    for _ in range(2):
        watch.moved(TURN)
    with pytest.raises(SensorLostError):
        push(watch, BLIND)


@pytest.mark.parametrize(("free_ahead_m", "lost"), [(0.39, False), (0.41, True)])
def test_a_robot_that_starts_at_a_wall_within_the_minimum_range_is_refused(free_ahead_m: float, lost: bool) -> None:
    watch = DepthWatch(
        replace(REAL, profile=PROFILE.model_copy(update={"camera": CAMERA})), GUARD, lambda: free_ahead_m
    )
    ended = False
    try:
        for _ in range(20):
            push(watch, BLIND)
    except SensorLostError:
        ended = True
    assert ended is lost


@pytest.mark.parametrize("identity", [REAL, IN_SIMULATION], ids=["real", "simulated"])
@pytest.mark.parametrize("result", [FORWARD, TURN, replace(FORWARD, displacement_m=-0.25)], ids=["on", "turn", "back"])
def test_an_unchanged_image_after_a_movement_is_a_frozen_camera(identity: RobotIdentity, result: MotionResult) -> None:
    watch = DepthWatch(identity, GUARD)
    watch.look(wall(3.0))
    watch.moved(result)
    with pytest.raises(SensorLostError, match="bit for bit: the camera is frozen"):
        watch.look(wall(3.0))


@pytest.mark.parametrize(
    "result",
    [
        MotionResult(completed=True),
        MotionResult(completed=False, displacement_m=0.25),
        MotionResult(completed=True, displacement_m=0.01, turn_rad=0.01),
    ],
    ids=["stood", "failed", "hardly moved"],
)
def test_an_unchanged_image_without_movement_is_accepted(result: MotionResult) -> None:
    watch = DepthWatch(REAL, GUARD)
    watch.look(wall(3.0))
    watch.moved(result)
    watch.look(wall(3.0))


def test_a_changed_image_after_a_movement_is_accepted() -> None:
    watch = DepthWatch(REAL, GUARD)
    for seed in range(3):
        watch.look(wall(3.0, seed))
        watch.moved(FORWARD)


def test_raw_frames_are_compared_if_the_depth_is_filtered() -> None:
    """Filtered, a frozen image is another one as long as the filter still holds frames from before."""
    watch = DepthWatch(REAL, GUARD)
    watch.look(replace(wall(3.0, 1), depth_frame_digest=b"frozen"))
    watch.moved(FORWARD)
    with pytest.raises(SensorLostError):
        watch.look(replace(wall(3.0, 2), depth_frame_digest=b"frozen"))
    same_by_chance = DepthWatch(REAL, GUARD)
    same_by_chance.look(replace(wall(3.0), depth_frame_digest=b"one"))
    same_by_chance.moved(FORWARD)
    same_by_chance.look(replace(wall(3.0), depth_frame_digest=b"another"))


def test_an_unchanged_empty_floor_is_accepted_in_simulation_only() -> None:
    simulated, real = DepthWatch(IN_SIMULATION, GUARD), DepthWatch(REAL, GUARD)
    for watch in (simulated, real):
        watch.look(floor())
        watch.moved(FORWARD)
    simulated.look(floor())
    with pytest.raises(SensorLostError):
        real.look(floor())


def test_depth_in_millimetres_that_should_be_metres_is_lost_at_the_first_look() -> None:
    with pytest.raises(SensorLostError, match="measures 3e\\+03 to 3e\\+03 m"):
        DepthWatch(REAL, GUARD).look(wall(3000.0))


def test_nothing_is_checked_without_depth_or_guard() -> None:
    off = DepthGuard(enabled=False)
    for watch, seen in (
        (DepthWatch(REAL, GUARD), replace(wall(3.0), depth_m=None)),
        (DepthWatch(REAL, off), wall(3000.0)),
    ):
        for _ in range(3):
            watch.look(seen)
            watch.moved(FORWARD)
