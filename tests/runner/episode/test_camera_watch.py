"""A camera that is blind, frozen or measures in another unit ends the episode; a correct one never does."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.runner.stand_ins import PROFILE
from vsnbench.errors import SensorLostError
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.runner.episode.camera_watch import CameraWatch
from vsnbench.runner.episode.depth_guard import Refusal, look_ahead
from vsnbench.runner.episode.hidden_region import MAX_HIDDEN_REFUSALS
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


COLOURS = np.random.default_rng(0)


def seeing(depth: Any, digest: bytes | None = None) -> Observation:
    """Return an observation with new colours, as a camera with noise sends them."""
    depth_m = np.asarray(np.broadcast_to(depth, (48, 64)), np.float32).copy()
    rgb = COLOURS.integers(0, 255, (48, 64, 3)).astype(np.uint8)
    return Observation(rgb, depth_m, Pose(0, 0), 0.0, CAMERA, depth_frame_digest=digest)


def wall(distance_m: float, seed: int = 0) -> Observation:
    return seeing(distance_m + 0.001 * np.random.default_rng(seed).random((48, 64)))


def floor() -> Observation:
    rays = CAMERA.rays(64, 48)
    depth_m = np.where(rays.up < -0.08, -rays.height_m / np.minimum(rays.up, -0.01), np.nan)
    return seeing(depth_m[:, None])


BLIND = seeing(np.nan)


def push(watch: CameraWatch, seen: Observation) -> None:
    watch.look(replace(seen, rgb=seeing(1.0).rgb))
    reading = look_ahead(seen, PROFILE.base, GUARD)
    watch.refused(reading)
    assert reading.refusal is Refusal.BLIND


def test_a_camera_that_stays_blind_is_lost_at_the_third_refusal() -> None:
    watch = CameraWatch(REAL, GUARD)
    watch.look(wall(3.0))
    for _ in range(MAX_HIDDEN_REFUSALS - 1):
        push(watch, BLIND)
    with pytest.raises(SensorLostError, match="stays blind: 3 forward moves were refused"):
        push(watch, BLIND)


def test_a_look_that_saw_the_path_resets_the_count() -> None:
    watch = CameraWatch(REAL, GUARD)
    for seed in range(4):
        push(watch, BLIND)
        push(watch, BLIND)
        watch.look(wall(3.0, seed))


def test_a_wall_below_the_minimum_range_is_not_a_lost_camera() -> None:
    watch = CameraWatch(REAL, GUARD)
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
    watch = CameraWatch(
        replace(REAL, profile=PROFILE.model_copy(update={"camera": CAMERA})), GUARD, lambda: free_ahead_m
    )
    ended = False
    try:
        for _ in range(20):
            push(watch, BLIND)
    except SensorLostError:
        ended = True
    assert ended is lost


RGB = wall(3.0).rgb
LIVE = {
    "depth": (wall(3.0), wall(3.0)),
    "colour": (replace(wall(3.0, 1), rgb=RGB), replace(wall(3.0, 2), rgb=RGB)),
}
"""Two looks, of which only the named image is unchanged."""


@pytest.mark.parametrize("what", LIVE)
@pytest.mark.parametrize("identity", [REAL, IN_SIMULATION], ids=["real", "simulated"])
@pytest.mark.parametrize("result", [FORWARD, TURN, replace(FORWARD, displacement_m=-0.25)], ids=["on", "turn", "back"])
def test_an_unchanged_image_after_a_movement_is_a_frozen_camera(
    identity: RobotIdentity, result: MotionResult, what: str
) -> None:
    watch = CameraWatch(identity, GUARD)
    before, after = LIVE[what]
    watch.look(before)
    watch.moved(result)
    with pytest.raises(SensorLostError, match=f"the {what} image has not changed .* bit for bit: the camera is frozen"):
        watch.look(after)


@pytest.mark.parametrize("what", LIVE)
@pytest.mark.parametrize(
    "result",
    [
        MotionResult(completed=True),
        MotionResult(completed=False, displacement_m=0.25),
        MotionResult(completed=True, displacement_m=0.01, turn_rad=0.01),
    ],
    ids=["stood", "failed", "hardly moved"],
)
def test_an_unchanged_image_without_movement_is_accepted(result: MotionResult, what: str) -> None:
    watch = CameraWatch(REAL, GUARD)
    before, after = LIVE[what]
    watch.look(before)
    watch.moved(result)
    watch.look(after)


def test_a_surface_of_one_colour_may_fill_the_image_in_simulation_only() -> None:
    """A real camera has noise; one that sends the same single colour from two poses has failed."""
    grey = np.full((48, 64, 3), 90, np.uint8)
    simulated, real = CameraWatch(IN_SIMULATION, GUARD), CameraWatch(REAL, GUARD)
    for watch in (simulated, real):
        watch.look(replace(wall(3.0, 1), rgb=grey))
        watch.moved(FORWARD)
    simulated.look(replace(wall(2.75, 2), rgb=grey))
    with pytest.raises(SensorLostError, match="colour"):
        real.look(replace(wall(2.75, 2), rgb=grey))


def test_a_frozen_colour_image_is_noticed_without_depth_and_with_the_guard_off() -> None:
    off = DepthGuard(enabled=False)
    before, after = LIVE["colour"]
    for watch, changes in ((CameraWatch(REAL, GUARD), {"depth_m": None}), (CameraWatch(REAL, off), {})):
        watch.look(replace(before, **changes))
        watch.moved(FORWARD)
        with pytest.raises(SensorLostError, match="the colour image"):
            watch.look(replace(after, **changes))


def test_a_changed_image_after_a_movement_is_accepted() -> None:
    watch = CameraWatch(REAL, GUARD)
    for seed in range(3):
        watch.look(wall(3.0, seed))
        watch.moved(FORWARD)


def test_raw_frames_are_compared_if_the_depth_is_filtered() -> None:
    """Filtered, a frozen image is another one as long as the filter still holds frames from before."""
    watch = CameraWatch(REAL, GUARD)
    watch.look(replace(wall(3.0, 1), depth_frame_digest=b"frozen"))
    watch.moved(FORWARD)
    with pytest.raises(SensorLostError):
        watch.look(replace(wall(3.0, 2), depth_frame_digest=b"frozen"))
    same_by_chance = CameraWatch(REAL, GUARD)
    same_by_chance.look(replace(wall(3.0), depth_frame_digest=b"one"))
    same_by_chance.moved(FORWARD)
    same_by_chance.look(replace(wall(3.0), depth_frame_digest=b"another"))


def test_an_unchanged_empty_floor_is_accepted_in_simulation_only() -> None:
    simulated, real = CameraWatch(IN_SIMULATION, GUARD), CameraWatch(REAL, GUARD)
    for watch in (simulated, real):
        watch.look(floor())
        watch.moved(FORWARD)
    simulated.look(floor())
    with pytest.raises(SensorLostError, match="the depth image"):
        real.look(floor())


def test_depth_in_millimetres_that_should_be_metres_is_lost_at_the_first_look() -> None:
    with pytest.raises(SensorLostError, match="measures 3e\\+03 to 3e\\+03 m"):
        CameraWatch(REAL, GUARD).look(wall(3000.0))


def test_no_depth_is_checked_without_depth_or_guard() -> None:
    off = DepthGuard(enabled=False)
    for watch, seen in (
        (CameraWatch(REAL, GUARD), replace(wall(3.0), depth_m=None)),
        (CameraWatch(REAL, off), wall(3000.0)),
    ):
        for _ in range(3):
            watch.look(replace(seen, rgb=seeing(1.0).rgb))
            watch.moved(FORWARD)
